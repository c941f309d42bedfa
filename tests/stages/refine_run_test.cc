#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"
#include "stages/refine/describe.h"
#include "stages/refine/run.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/triangulate/support.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kRotatedRad = 0.01;

/// Three markers that fly through what four cameras see, and a calibration whose last camera is turned by kTurnedRad.
RefineOptions MarkersToFit(const TempDir& folder, int num_frames = 120) {
  geometry::Rig rig = triangulate::MakeRing(4);
  std::string table = "camera,frame,person,joint,x_px,y_px,score\n";
  Rng rng(3);
  for (const geometry::RigCamera& camera : rig.cameras) {
    for (int f = 0; f < num_frames; ++f) {
      for (int j = 0; j < 3; ++j) {
        const Eigen::Vector3d x(0.5 * std::cos(0.2 * f + j), 0.5 * std::sin(0.31 * f - j), 0.4 * std::sin(0.17 * f + 2 * j));
        const auto at = geometry::Project(camera.camera, camera.cam_from_world * x);
        table += camera.camera.name + "," + std::to_string(f) + ",0," + std::to_string(j) + "," +
                 std::to_string(at.px.x() + 0.3 * rng.Normal()) + "," + std::to_string(at.px.y() + 0.3 * rng.Normal()) + ",1\n";
      }
    }
  }
  WriteFileAtomic(folder / "points2d.csv", table);
  geometry::Rigid3 turn;
  turn.rotation = geometry::RotationExp({0, kRotatedRad, 0});
  rig.cameras.back().cam_from_world = turn * rig.cameras.back().cam_from_world;
  geometry::WriteRig(rig, folder / "calibration.json");
  RefineOptions options;
  options.pose.calib = folder / "calibration.json", options.pose.points2d = folder / "points2d.csv";
  options.out = folder / "refined";
  return options;
}

TEST(RefineStage, ARotatedCameraIsRotatedBack) {
  const TempDir folder;
  const RefineReport report = RunRefine(MarkersToFit(folder));
  ASSERT_EQ(report.refined.status, Status::kOk) << report.refined.message;
  EXPECT_FALSE(report.refined.kept_input);
  EXPECT_LT(report.refined.after.median_px, 0.5 * report.refined.before.median_px);
  EXPECT_GT(report.fit.carried, 0.95);
  EXPECT_FALSE(report.causes) << "more than half fits the given rig";
  const geometry::Rig truth = triangulate::MakeRing(4), written = geometry::ReadRig(report.path);
  const auto between = [](const geometry::Rig& rig) {
    return rig.cameras[3].cam_from_world.rotation * rig.cameras[0].cam_from_world.rotation.conjugate();
  };
  EXPECT_LT(between(written).angularDistance(between(truth)), 0.2 * kRotatedRad);
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.folder, folder / "refined");
  EXPECT_EQ(said.outputs.at(0).path, report.path);
  EXPECT_THAT(said.text, HasSubstr("held-out frames before"));
  EXPECT_EQ(said.metrics["cameras"].size(), 4u);
}

TEST(RefineStage, CamerasWithoutPointsLeaveTheOthersCorrelated) {
  const TempDir folder;
  RefineOptions options = MarkersToFit(folder, 40);
  geometry::Rig five = geometry::ReadRig(options.pose.calib);
  for (geometry::RigCamera& camera : five.cameras)
    camera.cam_from_world.rotation = geometry::RotationExp({kRotatedRad, 0, 0}) * camera.cam_from_world.rotation;
  five.cameras.insert(five.cameras.begin(), triangulate::MakeRing(7).cameras[5]);
  geometry::WriteRig(five, options.pose.calib);
  const geometry::Rig written = geometry::ReadRig(RunRefine(options).path);
  ASSERT_EQ(written.cameras.size(), 5u);
  ASSERT_TRUE(geometry::HasJointCovariance(written));
  const geometry::StatedCovariance stated = geometry::StatedCovarianceOf(written);
  EXPECT_GT(stated.joint.block(stated.PoseRow(2), stated.PoseRow(3), 6, 6).norm(), 0);
  EXPECT_EQ(written.joint_covariance->leftCols(written.cameras[0].camera.params.size() + 6).norm(), 0) << "nothing is stated";
}

TEST(RefineStage, OptionsThatMakeNoSenseAreRefusedByName) {
  const TempDir folder;
  RefineOptions options = MarkersToFit(folder, 4);
  options.train_frames = "0:x";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunRefine(options); }), HasSubstr("option 'train-frames' 0:x: give START:STEP"));
  options.train_frames.clear(), options.person_height_m = 1.7;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunRefine(options); }), HasSubstr("option 'person-height' is for lenses"));
  options.out.clear();
  EXPECT_THAT(MessageOf<UsageError>([&] { RunRefine(options); }), HasSubstr("option 'out' is required"));
}

TEST(RefineStage, CamerasThatThePersonDoesNotPlaceAreAnError) {
  RefineReport report;
  report.options.out = "refined";
  report.placed.emplace();
  report.placed->status = Status::kDegenerate, report.placed->message = "camera b: no joint in common";
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitIllPosed);
  EXPECT_EQ(said.errors.at(0).code, "CAL-UNPLACED");
  EXPECT_EQ(said.folder, "");
  EXPECT_FALSE(said.metrics.contains("status"));
}

TEST(RefineStage, NextToNothingThatFitsFailsTheGate) {
  RefineReport report;
  report.path = "refined/calibration.json";
  report.fit.num_detections = 100, report.fit.carried = 0.1, report.fit.residual_px = 30;
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitQualityGate);
  EXPECT_EQ(said.errors.back().code, "CAL-NOFIT");
  report.fit.carried = 0.9;
  EXPECT_THAT(Describe(report).errors, IsEmpty());
}

}  // namespace
}  // namespace mvstudio::stages
