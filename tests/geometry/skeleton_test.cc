#include "geometry/skeleton/skeleton.h"

#include <cctype>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>

#include "core/error.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

namespace mvstudio::geometry {
namespace {

TEST(Skeleton, SizesAreThoseOfTheFormats) {
  const std::pair<const char*, size_t> sizes[] = {{"body25", 25},       {"body25b", 25},       {"body135", 135},
                                                  {"coco17", 17},       {"coco18", 18},        {"coco19", 19},
                                                  {"coco133", 133},     {"halpe26", 26},       {"halpe136", 136},
                                                  {"mediapipe33", 33},  {"mediapipe75", 75},   {"openpose137", 137},
                                                  {"body25+face", 95},  {"body25+hands", 67},  {"body25+face+hands", 137},
                                                  {"body25b+face", 95}, {"body25b+hands", 67}, {"body25b+face+hands", 137},
                                                  {"coco18+face", 88},  {"coco18+hands", 60},  {"coco18+face+hands", 130}};
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

// Index tables as published by COCO-WholeBody, Halpe-FullBody, MediaPipe and OpenPose (BODY_135).
TEST(Skeleton, WholeBodyIndicesAreThePublishedOnes) {
  const auto expect = [](const char* name, const std::vector<std::pair<const char*, int>>& joints) {
    for (const auto& [joint, index] : joints) EXPECT_EQ(SkeletonByName(name).Find(joint), index) << name << " " << joint;
  };
  expect("coco133", {{"RAnkle", 16},
                     {"LBigToe", 17},
                     {"LSmallToe", 18},
                     {"LHeel", 19},
                     {"RBigToe", 20},
                     {"RSmallToe", 21},
                     {"RHeel", 22},
                     {"Face0", 23},
                     {"Face67", 90},
                     {"LHandWrist", 91},
                     {"LThumb4", 95},
                     {"LPinky4", 111},
                     {"RHandWrist", 112},
                     {"RPinky4", 132},
                     {"Face68", -1}});
  expect("halpe26", {{"REar", 4},
                     {"Head", 17},
                     {"Neck", 18},
                     {"MidHip", 19},
                     {"LBigToe", 20},
                     {"RBigToe", 21},
                     {"LSmallToe", 22},
                     {"RSmallToe", 23},
                     {"LHeel", 24},
                     {"RHeel", 25}});
  expect("halpe136", {{"RHeel", 25},
                      {"Face0", 26},
                      {"Face67", 93},
                      {"LHandWrist", 94},
                      {"LPinky4", 114},
                      {"RHandWrist", 115},
                      {"RPinky4", 135}});
  expect("mediapipe33", {{"LEye", 2},
                         {"REye", 5},
                         {"LEar", 7},
                         {"RMouth", 10},
                         {"LShoulder", 11},
                         {"RWrist", 16},
                         {"LPinky", 17},
                         {"RThumb", 22},
                         {"LHip", 23},
                         {"RAnkle", 28},
                         {"LHeel", 29},
                         {"RFootIndex", 32}});
  expect("mediapipe75", {{"LHandWrist", 33}, {"LIndex1", 38}, {"RHandWrist", 54}, {"RPinky4", 74}});
  expect("body135", {{"RHeel", 24},
                     {"LThumb1", 25},
                     {"LPinky4", 44},
                     {"RThumb1", 45},
                     {"RPinky4", 64},
                     {"Face0", 65},
                     {"Face69", 134},
                     {"LHandWrist", -1}});
  expect("openpose137", {{"RHeel", 24}, {"Face0", 25}, {"Face69", 94}, {"LHandWrist", 95}, {"RHandWrist", 116}});
}

TEST(Skeleton, PartsTileTheJoints) {
  for (const std::string& name : SkeletonNames()) {
    const Skeleton& skeleton = SkeletonByName(name);
    if (skeleton.parts.empty()) continue;
    int next = 0;
    for (const SkeletonPart& part : skeleton.parts) {
      EXPECT_EQ(part.first, next) << name;
      next += part.count;
    }
    EXPECT_EQ(next, static_cast<int>(skeleton.joints.size())) << name;
  }
  const auto& parts = SkeletonByName("body25+face+hands").parts;
  ASSERT_EQ(parts.size(), 4u);
  EXPECT_EQ(parts[1].kind, SkeletonPart::Kind::kFace);
  EXPECT_EQ(parts[1].count, 70);
  EXPECT_EQ(parts[3].kind, SkeletonPart::Kind::kRightHand);
  EXPECT_EQ(parts[3].count, 21);
}

TEST(Skeleton, EverySidedJointHasItsMirror) {
  for (const std::string& name : SkeletonNames()) {
    const Skeleton& skeleton = SkeletonByName(name);
    const auto pairs = MirrorJoints(skeleton);
    std::set<int> paired;
    for (const auto& [left, right] : pairs) {
      EXPECT_TRUE(paired.insert(left).second && paired.insert(right).second) << name;
    }
    for (size_t i = 0; i < skeleton.joints.size(); ++i) {
      const std::string& joint = skeleton.joints[i];
      const bool sided = (joint[0] == 'L' || joint[0] == 'R') && std::isupper(static_cast<unsigned char>(joint[1]));
      if (joint.rfind("Face", 0) == 0) continue;
      EXPECT_EQ(paired.count(static_cast<int>(i)), sided ? 1u : 0u) << name << " " << joint;
    }
  }
  // 68 points of a face: 8 of the jaw's 17, 5 brows, 2 of 5 nostrils, 6 lids, 5 of 12 outer and 3 of 8 inner lips.
  EXPECT_EQ(MirrorJoints(SkeletonByName("coco133")).size(), 8u + 3u + 21u + 8u + 5u + 2u + 6u + 5u + 3u);
}

TEST(Skeleton, MirrorKnowsOtherPeoplesNames) {
  const Skeleton skeleton = PointsSkeleton({"left_knee", "right_knee", "paw_l", "paw_r", "Ear.L", "Ear.R", "tail", "leftover",
                                            "LWing", "RWing", "Hand Left", "Hand Right"});
  EXPECT_THAT(MirrorJoints(skeleton),
              ElementsAre(std::pair{0, 1}, std::pair{2, 3}, std::pair{4, 5}, std::pair{8, 9}, std::pair{10, 11}));
}

TEST(Skeleton, MirrorGroupsAreHeadArmsLegs) {
  const auto sizes = [](const char* name) {
    std::vector<size_t> counts;
    for (const auto& group : MirrorGroups(SkeletonByName(name))) counts.push_back(group.size());
    return counts;
  };
  EXPECT_THAT(sizes("body25"), ElementsAre(2, 3, 6));
  EXPECT_THAT(sizes("coco17"), ElementsAre(2, 3, 3));
  EXPECT_THAT(sizes("mediapipe75"), ElementsAre(5, 6 + 21, 5));
  EXPECT_THAT(MirrorGroups(PointsSkeleton({"LWing", "RWing", "tail"})), ElementsAre(ElementsAre(std::pair{0, 1})));
  EXPECT_THAT(MirrorGroups(PointsSkeleton({"tail"})), IsEmpty());
}

TEST(Skeleton, PointsWhereTheNameIsUnknown) {
  EXPECT_EQ(SkeletonOrPoints("coco17", {"Nose", "LHip"}).joints.size(), 17u);
  EXPECT_EQ(SkeletonOrPoints("points", {"Nose", "LHip"}).joints.size(), 2u);
  EXPECT_EQ(SkeletonOrPoints("coco17", {"Nose", "tail"}).name, "points");
}

// A real rendering of 137 joints (BODY_25, face, hands): points that two lists share must coincide, the face's right eye lies
// at the body's right eye.
TEST(Skeleton, OpenPose137FitsRealKeyPoints) {
  MVS_NEEDS_DATA("tna_keypoints");
  const Skeleton& skeleton = SkeletonByName("openpose137");
  std::ifstream file(mvstudio::testing::DataRoot() + "/tna_keypoints/person_1/100000.json");
  std::string text((std::istreambuf_iterator<char>(file)), {});
  for (char& c : text) {
    if (!std::isdigit(static_cast<unsigned char>(c)) && c != '.' && c != '-' && c != 'e') c = ' ';
  }
  std::istringstream stream(text);
  std::vector<double> numbers;
  for (double number; stream >> number;) numbers.push_back(number);
  ASSERT_EQ(numbers.size(), 3 * skeleton.joints.size());
  const auto distance = [&](const char* a, const char* b) {
    const int i = skeleton.Find(a), j = skeleton.Find(b);
    return std::hypot(numbers[3 * i] - numbers[3 * j], numbers[3 * i + 1] - numbers[3 * j + 1]);
  };
  EXPECT_LT(distance("LWrist", "LHandWrist"), 1e-6);
  EXPECT_LT(distance("RWrist", "RHandWrist"), 1e-6);
  EXPECT_LT(distance("Nose", "Face30"), 10);
  EXPECT_LT(distance("REye", "Face68"), 10);
  EXPECT_LT(distance("LEye", "Face69"), 10);
  EXPECT_GT(distance("REye", "Face69"), 20);
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
    // COCO's 17 joints have no neck: the face hangs on nothing. Nor does MediaPipe's, and its mouth hangs on nothing either.
    const size_t expected = name.rfind("coco1", 0) == 0 && skeleton.Find("Neck") < 0 ? 2 : name.rfind("media", 0) == 0 ? 3 : 1;
    EXPECT_EQ(parts.size(), expected) << name;
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
  EXPECT_THAT(Coco19From(SkeletonByName("coco133"))[0], ElementsAre(5, 6));
  EXPECT_THAT(Coco19From(SkeletonByName("coco133"))[14], ElementsAre(16));
  EXPECT_THAT(Coco19From(SkeletonByName("halpe136"))[0], ElementsAre(5, 6));  // its Neck is the upper neck, too
  EXPECT_THAT(Coco19From(SkeletonByName("halpe136"))[2], ElementsAre(19));
  EXPECT_THAT(Coco19From(SkeletonByName("mediapipe75"))[2], ElementsAre(23, 24));
  EXPECT_THAT(Coco19From(SkeletonByName("mediapipe75"))[18], ElementsAre(8));
  EXPECT_THAT(Coco19From(SkeletonByName("openpose137"))[0], ElementsAre(1));
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
}  // namespace mvstudio::geometry
