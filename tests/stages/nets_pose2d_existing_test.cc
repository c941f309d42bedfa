#include <filesystem>

#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "stages/nets/pose2d/existing.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

struct Joint {
  double x = 0, y = 0, score = 0;
};

/// One person whose first joints these are; the others of the 25 are not detected.
std::string Json(const std::vector<Joint>& joints) {
  std::string numbers;
  for (size_t j = 0; j < 25; ++j) {
    const Joint joint = j < joints.size() ? joints[j] : Joint();
    for (const double value : {joint.x, joint.y, joint.score}) numbers += (numbers.empty() ? "" : ",") + std::to_string(value);
  }
  return R"({"people": [{"pose_keypoints_2d": [)" + numbers + "]}]}";
}

const geometry::Skeleton& Body25() { return geometry::SkeletonByName("body25"); }

/// Images of 100 x 80 px.
dataset::CameraFootage PutFootage(const TempDir& folder, const std::string& camera) {
  for (const char* name : {"/0.png", "/1.png", "/2.png"})
    dataset::WriteImage(Image(100, 80, 3), folder / "raw/" + camera + name);
  return {camera, folder / "raw/" + camera, ""};
}

TEST(ExistingPoses, JointsThatCannotBeRightAreNotDetected) {
  const TempDir folder;
  Put(folder / "poses/a/0_keypoints.json",
      Json({{50, 40, 0.5}, {-99, 40, 0.5}, {-101, 40, 0.5}, {50, 159, 0.5}, {50, 161, 0.5}, {60, 50, 1.5}, {60, 50, -0.5}}));
  Put(folder / "poses/a/1_keypoints.json", R"({"people": []})");
  InputNotes notes;
  const std::vector<CameraPoses> cameras = ReadExistingPoses(folder / "poses", {PutFootage(folder, "a")}, Body25(), &notes);
  ASSERT_EQ(cameras.size(), 1u);
  EXPECT_EQ(cameras[0].track.camera, "a");
  EXPECT_EQ(cameras[0].width, 100);
  EXPECT_EQ(cameras[0].height, 80);
  EXPECT_EQ(cameras[0].frames, 2);
  EXPECT_EQ(cameras[0].frames_with_people, 1);
  const auto& joints = cameras[0].track.frames.at(0)[0].keypoints;
  std::vector<double> scores;
  for (int j = 0; j < 7; ++j) scores.push_back(joints[j].score);
  EXPECT_THAT(scores, ElementsAre(0.5, 0.5, 0, 0.5, 0, 1, 0)) << "outside by more than the picture's size; above 1; below 0";
  EXPECT_EQ(joints[1].x_px, -99);
  EXPECT_EQ(joints[2].x_px, 0) << "not detected, and so nowhere";
  ASSERT_EQ(notes.warnings.size(), 1u);
  EXPECT_EQ(notes.warnings[0].code, "POSE-JOINTS");
  EXPECT_THAT(notes.warnings[0].text, HasSubstr("a: 3 joints"));
  EXPECT_THAT(notes.inputs, ElementsAre(folder / "poses/a"));
}

TEST(ExistingPoses, WithoutFootageEveryFolderIsACameraAndNoPlaceIsOutside) {
  const TempDir folder;
  for (const char* camera : {"b", "a"}) Put(folder / "poses/" + camera + "/7_keypoints.json", Json({{-5000, 9, 0.5}}));
  Put(folder / "poses/notes.txt", "no camera");
  InputNotes notes;
  const std::vector<CameraPoses> cameras = ReadExistingPoses(folder / "poses", {}, Body25(), &notes);
  ASSERT_EQ(cameras.size(), 2u);
  EXPECT_EQ(cameras[0].track.camera, "a");
  EXPECT_EQ(cameras[1].track.frames.at(7)[0].keypoints[0].x_px, -5000);
  EXPECT_TRUE(notes.warnings.empty());
}

TEST(ExistingPoses, FoldersThatAreNotThereAreNamed) {
  const TempDir folder;
  InputNotes notes;
  const auto read = [&](const std::vector<dataset::CameraFootage>& footage) {
    ReadExistingPoses(folder / "poses", footage, Body25(), &notes);
  };
  EXPECT_THAT(MessageOf<UsageError>([&] { read({}); }), HasSubstr("option 'backend' openpose:" + (folder / "poses")));
  std::filesystem::create_directories(folder / "poses");
  EXPECT_THAT(MessageOf<UsageError>([&] { read({}); }), HasSubstr("has no folder of a camera"));
  EXPECT_THAT(MessageOf<IoError>([&] { read({PutFootage(folder, "a")}); }), HasSubstr(folder / "poses/a"));
}

}  // namespace
}  // namespace mvstudio::stages
