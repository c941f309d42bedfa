#include "stages/input/pose3d_input.h"

#include "core/error.h"
#include "dataset/panoptic/panoptic.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

/// Neck and nose in frame 4, by their places in Panoptic's list.
constexpr int kNeck = 0, kNose = 1;
const Eigen::Vector3d kNeckAt(0.1, 0.2, 1.5), kNoseAt(0.15, 0.1, 1.6);

void ExpectBoth(const std::string& path, double tolerance_m) {
  SCOPED_TRACE(path);
  const auto poses = ReadCoco19Poses(path);
  ASSERT_EQ(poses.count(4), 1u);
  const dataset::Coco19Pose& pose = poses.at(4).begin()->second;
  ASSERT_TRUE(pose.valid[kNeck] && pose.valid[kNose]);
  EXPECT_LT((pose.x_in_world.col(kNeck) - kNeckAt).norm(), tolerance_m);
  EXPECT_LT((pose.x_in_world.col(kNose) - kNoseAt).norm(), tolerance_m);
  EXPECT_FALSE(pose.valid[5]);
}

dataset::JointRow Row(const std::string& joint, const Eigen::Vector3d& x) {
  dataset::JointRow row;
  row.frame = 4, row.joint = joint, row.status = Status::kOk, row.x_in_world = x;
  return row;
}

/// y up: (y, z, x) of our world.
std::string Trc(const std::string& first, const std::string& second) {
  return "PathFileType\t4\t(X/Y/"
         "Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\t"
         "OrigNumFrames\n50\t50\t1\t2\tm\t50\t5\t1\nFrame#\tTime\t" +
         first + "\t\t\t" + second + "\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n5\t0.08\t0.2\t1.5\t0.1\t0.1\t1.6\t0.15\n";
}

TEST(Pose3dInput, EveryFormGivesTheSameJoints) {
  const TempDir folder;
  dataset::WritePose3d({"coco19", {Row("Neck", kNeckAt), Row("Nose", kNoseAt)}}, folder / "points");
  ExpectBoth(folder / "points", 1e-12);
  Put(folder / "a.trc", Trc("Neck", "Nose"));
  ExpectBoth(folder / "a.trc", 1e-12);
  dataset::Coco19Pose pose;
  pose.x_in_world.col(kNeck) = kNeckAt, pose.x_in_world.col(kNose) = kNoseAt;
  pose.valid[kNeck] = pose.valid[kNose] = true;
  for (const char* place : {"scenes", "data/hdPose3d_stage1_coco19"})
    dataset::WriteBody3dScene({{0, pose}}, 0, folder / (std::string(place) + "/body3DScene_00000004.json"));
  ExpectBoth(folder / "scenes", 1e-5);
  ExpectBoth(folder / "data", 1e-5);
}

TEST(Pose3dInput, WhatIsNoPoseIsSaid) {
  const TempDir folder;
  EXPECT_THAT(MessageOf<IoError>([&] { ReadCoco19Poses(folder / "gone"); }), HasSubstr("a folder with points.csv"));
  Put(folder / "empty/readme.txt", "nothing");
  EXPECT_THROW(ReadCoco19Poses(folder / "empty"), IoError);
  Put(folder / "b.trc", Trc("tail", "whisker"));
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadCoco19Poses(folder / "b.trc"); }),
              AllOf(HasSubstr("b.trc"), HasSubstr("tail"), HasSubstr("whisker")));
  Put(folder / "odd/body3DScene_x.json", "{}");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadCoco19Poses(folder / "odd"); }), HasSubstr("body3DScene_%08d.json"));
}

}  // namespace
}  // namespace mvstudio::stages
