#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "calib/corners/corner_files.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/alignment.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"
#include "tests/calib/synthetic.h"
#include "tests/support/run_cli.h"

/// calib align as a user runs them.
namespace mvstudio::testing {
namespace {

using ::testing::HasSubstr;

class MovedRigs : public ::testing::Test {
 protected:
  MovedRigs() {
    calib::testing::SceneOptions options;
    options.num_cameras = 3, options.num_frames = 6, options.noise_px = 0.05;
    scene_ = calib::testing::MakeScene(options);
    rig_ = calib::testing::TruthRig(scene_);
    rig_.gauge = "camera cam0";
    geometry::WriteRig(rig_, folder_ / "rig.json");
    calib::CornerFile corners;
    const calib::CalibrateInput input = calib::testing::ToInput(scene_);
    corners.cameras = input.cameras, corners.boards = input.boards, corners.detections = input.detections;
    calib::WriteCornerFile(corners, folder_ / "corners.csv");
  }

  geometry::Rig Written() const { return geometry::ReadRig(folder_ / "new.json"); }
  std::string Error(const CliRun& run) const { return run.out + run.err; }

  TempDir folder_;
  calib::testing::Scene scene_;
  geometry::Rig rig_;
};

TEST_F(MovedRigs, TheBoardOnTheFloorGivesTheWorld) {
  const int64_t frame = scene_.truth.frames[2];
  const CliRun run = RunCli({"calib", "align", folder_ / "rig.json", "--floor-board", std::to_string(frame), "--corners",
                             folder_ / "corners.csv", "--out", folder_ / "new.json", "--json"});
  ASSERT_EQ(run.exit, 0) << Error(run);
  EXPECT_LT(run.Json()["metrics"]["rms_px"].get<double>(), 0.15);
  EXPECT_EQ(Written().gauge, "board in frame " + std::to_string(frame));
  EXPECT_LT(geometry::CompareRigs(Written(), rig_).max_translation_m, 1e-9) << "the rig moved as a whole";
}

TEST_F(MovedRigs, PointsOfBothWorldsMoveAndScaleIt) {
  std::ofstream(folder_ / "pairs.csv")
      << "point,x,y,z,x_old,y_old,z_old\na,0,0,0,1,0,0\nb,2,0,0,2,0,0\nc,0,2,0,1,1,0\nd,0,0,2,1,0,1\n";
  const CliRun run = RunCli({"calib", "align", folder_ / "rig.json", "--points", folder_ / "pairs.csv", "--scale", "--out",
                             folder_ / "new.json", "--json"});
  ASSERT_EQ(run.exit, 0) << Error(run);
  EXPECT_NEAR(run.Json()["metrics"]["scale"].get<double>(), 2, 1e-12);
  EXPECT_EQ(Written().gauge, "the marked points; uncertainty relative to camera cam0");
  const Eigen::Vector3d wanted = 2 * (rig_.cameras[1].CenterInWorld() - Eigen::Vector3d::UnitX());
  EXPECT_LT((Written().cameras[1].CenterInWorld() - wanted).norm(), 1e-9);
}

TEST_F(MovedRigs, PeopleWhoStandStillGiveNoFloor) {
  dataset::Pose3d pose;
  pose.skeleton = "coco17", pose.world = "right-handed, axes of camera cam0: x right, y down, z forward";
  for (int frame = 0; frame < 60; ++frame) {
    for (const auto& [joint, z] : {std::pair{"LHip", 0.9}, {"RHip", 0.9}, {"LAnkle", 0.1}, {"RAnkle", 0.1}}) {
      dataset::JointRow row;
      row.frame = frame, row.joint = joint, row.status = Status::kOk;
      row.x_in_world = Eigen::Vector3d(joint[0] == 'L' ? 0.1 : -0.1, 0, z);
      pose.rows.push_back(row);
    }
  }
  dataset::WritePose3d(pose, folder_ / "pose3d");
  const CliRun run =
      RunCli({"calib", "align", folder_ / "rig.json", "--floor-joints", folder_ / "pose3d", "--out", folder_ / "new.json"});
  EXPECT_EQ(run.exit, 5) << Error(run);
  EXPECT_THAT(Error(run), HasSubstr("feet stand in 2 places"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "new.json"));
}

TEST_F(MovedRigs, OneWorldIsAskedFor) {
  const auto align = [&](std::vector<std::string> words) {
    words.insert(words.begin(), {"calib", "align", folder_ / "rig.json", "--out", folder_ / "new.json"});
    return RunCli(words);
  };
  EXPECT_EQ(align({}).exit, 2);
  EXPECT_THAT(Error(align({"--floor-board", "3", "--points", folder_ / "pairs.csv"})), HasSubstr("give one of --floor-board"));
  EXPECT_THAT(Error(align({"--floor-board", "3"})), HasSubstr("needs the board's corners"));
  EXPECT_THAT(Error(align({"--floor-board", "3", "--corners", folder_ / "corners.csv"})),
              HasSubstr("sees the board in frame 3"));
  EXPECT_THAT(Error(align({"--floor-joints", folder_ / "pose3d", "--scale"})), HasSubstr("--scale belongs to --points"));
}

}  // namespace
}  // namespace mvstudio::testing
