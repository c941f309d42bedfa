#include "body/skeleton.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "core/error.h"

namespace mvstudio::body {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(Skeleton, SizesAreThoseOfTheFormats) {
  const std::pair<const char*, size_t> sizes[] = {
      {"body25", 25}, {"body25b", 25}, {"coco17", 17}, {"coco18", 18}, {"coco19", 19}};
  for (const auto& [name, size] : sizes) {
    const Skeleton& skeleton = SkeletonByName(name);
    EXPECT_EQ(skeleton.joints.size(), size) << name;
    EXPECT_EQ(std::set<std::string>(skeleton.joints.begin(), skeleton.joints.end()).size(), size) << name;
  }
  EXPECT_EQ(SkeletonNames().size(), std::size(sizes));
}

// Index tables as published by OpenPose (poseParameters.cpp) and CMU Panoptic.
TEST(Skeleton, IndicesAreThePublishedOnes) {
  const Skeleton& body25 = SkeletonByName("body25");
  EXPECT_EQ(body25.Find("Neck"), 1);
  EXPECT_EQ(body25.Find("MidHip"), 8);
  EXPECT_EQ(body25.Find("LAnkle"), 14);
  EXPECT_EQ(body25.Find("REye"), 15);
  EXPECT_EQ(body25.Find("LBigToe"), 19);
  EXPECT_EQ(body25.Find("RHeel"), 24);
  const Skeleton& body25b = SkeletonByName("body25b");
  EXPECT_EQ(body25b.Find("LEye"), 1);
  EXPECT_EQ(body25b.Find("RShoulder"), 6);
  EXPECT_EQ(body25b.Find("RAnkle"), 16);
  EXPECT_EQ(body25b.Find("Neck"), 17);
  EXPECT_EQ(body25b.Find("Head"), 18);
  EXPECT_EQ(body25b.Find("LHeel"), 21);
  EXPECT_EQ(body25b.Find("MidHip"), -1);
  EXPECT_EQ(SkeletonByName("coco18").Find("LEar"), 17);
  EXPECT_EQ(SkeletonByName("coco17").Find("RAnkle"), 16);
  EXPECT_EQ(Coco19().Find("Neck"), 0);
  EXPECT_EQ(Coco19().Find("MidHip"), 2);
  EXPECT_EQ(Coco19().Find("RAnkle"), 14);
  EXPECT_EQ(Coco19().Find("LEar"), 16);
  EXPECT_EQ(Coco19().Find("REar"), 18);
}

TEST(Skeleton, BonesConnectEveryJoint) {
  for (const std::string& name : SkeletonNames()) {
    const Skeleton& skeleton = SkeletonByName(name);
    std::vector<int> part(skeleton.joints.size());
    for (size_t i = 0; i < part.size(); ++i) part[i] = static_cast<int>(i);
    for (size_t round = 0; round < part.size(); ++round) {
      for (const auto& [i, j] : skeleton.bones) part[i] = part[j] = std::min(part[i], part[j]);
    }
    const std::set<int> parts(part.begin(), part.end());
    // COCO's 17 joints have no neck: the face hangs on nothing.
    EXPECT_EQ(parts.size(), name == "coco17" ? 2u : 1u) << name;
  }
}

TEST(Skeleton, UnknownNameListsTheKnownOnes) {
  try {
    SkeletonByName("body24");
    FAIL();
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("body24"));
    EXPECT_THAT(error.what(), HasSubstr("body25b"));
  }
}

TEST(Coco19From, TakesOwnJointsOrMeans) {
  const auto from25 = Coco19From(SkeletonByName("body25"));
  EXPECT_THAT(from25[0], ElementsAre(1));
  EXPECT_THAT(from25[2], ElementsAre(8));
  EXPECT_THAT(from25[3], ElementsAre(5));
  const auto from25b = Coco19From(SkeletonByName("body25b"));
  EXPECT_THAT(from25b[0], ElementsAre(5, 6));  // its Neck is the upper neck
  EXPECT_THAT(from25b[2], ElementsAre(11, 12));
  const auto from17 = Coco19From(SkeletonByName("coco17"));
  EXPECT_THAT(from17[0], ElementsAre(5, 6));
  EXPECT_THAT(from17[15], ElementsAre(1));
  const auto from18 = Coco19From(SkeletonByName("coco18"));
  EXPECT_THAT(from18[0], ElementsAre(1));
  EXPECT_THAT(from18[2], ElementsAre(11, 8));
  const auto self = Coco19From(Coco19());
  for (int k = 0; k < 19; ++k) EXPECT_THAT(self[k], ElementsAre(k));
}

TEST(Coco19From, LeavesOutWhatCannotBeHad) {
  const auto sources = Coco19From(Skeleton{"legs", {"LHip", "LKnee"}, {}});
  EXPECT_THAT(sources[2], IsEmpty());
  EXPECT_THAT(sources[0], IsEmpty());
  EXPECT_THAT(sources[7], ElementsAre(1));
}

}  // namespace
}  // namespace mvstudio::body
