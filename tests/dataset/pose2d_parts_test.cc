#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "core/format.h"
#include "dataset/pose/pose2d.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

/// A folder of OpenPose files that is read in parts.
namespace mvstudio::dataset {
namespace {

void PutPerson(const std::string& folder, int frame) {
  std::string numbers;
  for (int k = 0; k < 51; ++k) numbers += Format("%s%d.5", k ? "," : "", frame + k);
  std::ofstream(folder + Format("/%08d_keypoints.json", frame)) << "{\"people\":[{\"pose_keypoints_2d\":[" << numbers << "]}]}";
}

TEST(Pose2dParts, PartsTogetherAreTheWhole) {
  const testing::TempDir folder;
  for (int frame = 0; frame < 50; frame += 3) PutPerson(folder.path(), frame);
  const geometry::Skeleton skeleton = geometry::SkeletonByName("coco17");
  const Pose2dTrack whole = ReadOpenPoseFolder(folder.path(), "cam", skeleton);
  const OpenPoseFolder parts(folder.path(), "cam");
  EXPECT_EQ(parts.num_files(), 17u);
  EXPECT_EQ(parts.Frames(), OpenPoseFrames(folder.path(), "cam"));
  size_t together = 0;
  for (int first = 0; first < 50; first += 10) {
    for (const auto& [frame, people] : parts.Read(skeleton, {first, first + 9, true}).frames) {
      EXPECT_GE(frame, first);
      EXPECT_LE(frame, first + 9);
      ASSERT_EQ(whole.frames.count(frame), 1u) << frame;
      EXPECT_EQ(people.front().keypoints.at(16).y_px, whole.frames.at(frame).front().keypoints.at(16).y_px);
      ++together;
    }
  }
  EXPECT_EQ(together, whole.frames.size());
  EXPECT_EQ(parts.Read(skeleton, {4, 40, true, 5}).frames.size(), 3u) << "6, 21 and 36 of the twelve from 6 to 39";
  EXPECT_TRUE(parts.Read(skeleton, {49, 60, true}).frames.empty());
}

/// A list for every part would take longer than the part.
TEST(Pose2dParts, TheFolderIsListedOnce) {
  const testing::TempDir folder;
  for (int frame = 0; frame < 6; ++frame) PutPerson(folder.path(), frame);
  const geometry::Skeleton skeleton = geometry::SkeletonByName("coco17");
  const OpenPoseFolder parts(folder.path(), "cam");
  PutPerson(folder.path(), 6);
  EXPECT_EQ(parts.Read(skeleton, {0, 100, true}).frames.size(), 6u) << "what came later is not seen";
  std::filesystem::remove(folder.path() + "/00000002_keypoints.json");
  EXPECT_EQ(parts.Read(skeleton, {3, 100, true}).frames.size(), 3u);
  const std::string message = testing::MessageOf<IoError>([&] { parts.Read(skeleton, {0, 100, true}); });
  EXPECT_NE(message.find("00000002"), std::string::npos) << message;
}

}  // namespace
}  // namespace mvstudio::dataset
