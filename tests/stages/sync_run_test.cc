#include <cmath>

#include "core/error.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"
#include "stages/sync/describe.h"
#include "stages/sync/run.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"
#include "tests/triangulate/support.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

const std::vector<double> kLateFrames{0, 12, -7.4};

/// Three cameras of a ring and 25 joints that move; camera c shows in its frame f the time f - kLateFrames[c].
SyncOptions TakeToSync(const TempDir& folder, bool moves) {
  const geometry::Rig rig = triangulate::MakeRing(3);
  geometry::WriteRig(rig, folder / "calibration.json");
  SyncOptions options;
  options.pose.calib = folder / "calibration.json", options.out = folder / "sync";
  Rng rng(2);
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    dataset::Pose2dTrack track;
    track.camera = rig.cameras[c].camera.name;
    for (int f = 0; f < 120; ++f) {
      const double t = moves ? (f - kLateFrames[c]) / 30 : 0;
      dataset::Person2d person;
      for (int j = 0; j < 25; ++j) {
        const Eigen::Vector3d x(0.3 * std::cos(2.4 * j) + 0.2 * std::sin(2.1 * t + j) + 0.1 * std::sin(5.3 * t),
                                0.3 * std::sin(2.4 * j) + 0.2 * std::sin(1.3 * t - j),
                                0.06 * j - 0.7 + 0.12 * std::sin(3.7 * t + 2 * j));
        const auto at = geometry::Project(rig.cameras[c].camera, rig.cameras[c].cam_from_world * x);
        person.keypoints.push_back({at.px.x() + rng.Normal(), at.px.y() + rng.Normal(), 0.9});
      }
      track.frames[f] = {person};
    }
    dataset::WriteOpenPoseFolder(track, folder / track.camera);
    options.pose.pose2d.push_back({track.camera, folder / track.camera});
  }
  return options;
}

TEST(SyncStage, OffsetsAreThoseOfTheTakeAndOfItsFile) {
  const TempDir folder;
  SyncOptions options = TakeToSync(folder, true);
  options.search.reference = "cam_0", options.fps_hz = 30;
  const SyncReport report = RunSync(options);
  ASSERT_TRUE(report.by_poses);
  EXPECT_FALSE(report.Failed());
  EXPECT_EQ(report.num_ok(), 3);
  ASSERT_EQ(report.by_poses->cameras.size(), 3u);
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(report.by_poses->cameras[c].offset_frames, kLateFrames[c], 0.2) << c;
  const dataset::SyncFile kept = dataset::ReadSync(report.path);
  EXPECT_EQ(kept.reference, "cam_0");
  EXPECT_EQ(kept.fps, 30);
  EXPECT_EQ(kept.cameras[1].offset_frames, report.file.cameras[1].offset_frames);
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitOk);
  EXPECT_EQ(said.folder, folder / "sync");
  EXPECT_EQ(said.metrics["cameras"][1]["offset_frames"], *report.file.cameras[1].offset_frames);
  EXPECT_NEAR(said.metrics["cameras"][1]["offset_ms"].get<double>(), 400, 10);
  EXPECT_THAT(said.errors, IsEmpty());
}

TEST(SyncStage, ATakeWithoutMotionFailsAndLeavesTheOlderFile) {
  const TempDir folder;
  SyncOptions options = TakeToSync(folder, true);
  const std::string path = RunSync(options).path;
  const TempDir still;
  SyncOptions nobody_moves = TakeToSync(still, false);
  nobody_moves.out = options.out;
  const SyncReport report = RunSync(nobody_moves);
  EXPECT_TRUE(report.Failed());
  EXPECT_TRUE(report.kept_older);
  EXPECT_EQ(dataset::ReadSync(path).cameras[1].status, "Ok");
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitIllPosed);
  EXPECT_EQ(said.folder, "") << "nothing of this run is kept there";
  EXPECT_THAT(said.outputs, IsEmpty());
  ASSERT_FALSE(said.errors.empty());
  EXPECT_EQ(said.errors[0].code, "SYN-UNDETERMINED");
  EXPECT_EQ(said.warnings.back().code, "CLI-OLDER-KEPT");
}

/// An error that all cameras share moves the world, and no clock.
TEST(SyncStage, CorrelatedErrorsOfTheRigAreNoErrorsOfTheClocks) {
  const TempDir folder;
  SyncOptions options = TakeToSync(folder, true);
  const auto sigma = [&] { return RunSync(options).by_poses->cameras[1].sigma_frames; };
  const double exact = sigma();
  geometry::Rig rig = geometry::ReadRig(options.pose.calib);
  geometry::StatedCovariance stated = geometry::StatedCovarianceOf(rig);
  Eigen::MatrixXd moved = Eigen::MatrixXd::Zero(stated.joint.rows(), 6);  // all poses by a rotation and a shift of the world
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const Eigen::Matrix3d rotation = rig.cameras[c].cam_from_world.rotation.toRotationMatrix();
    moved.block<3, 3>(stated.PoseRow(c), 0) = moved.block<3, 3>(stated.PoseRow(c) + 3, 3) = rotation;
    stated.lens_known[c] = stated.pose_known[c] = true;
  }
  stated.joint = 1e-3 * moved * moved.transpose() + 1e-12 * Eigen::MatrixXd::Identity(moved.rows(), moved.rows());
  for (const bool correlated : {true, false}) {
    stated.correlated = correlated;
    geometry::StoreCovariance(stated, &rig);
    geometry::WriteRig(rig, options.pose.calib);
    const double ratio = sigma() / exact;
    EXPECT_GT(ratio, correlated ? 0.99 : 2.0);
    EXPECT_LT(ratio, correlated ? 1.01 : 1e4);
  }
}

TEST(SyncStage, WhatIsMissingIsNamed) {
  EXPECT_THAT(MessageOf<UsageError>([] { RunSync({}); }), HasSubstr("option 'out' is required"));
  const TempDir folder;
  SyncOptions options;
  options.out = folder / "sync";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunSync(options); }), HasSubstr("option 'calib' is required"));
  options.from = SyncSource::kMotionEnergy;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunSync(options); }),
              HasSubstr("option 'from' motion-energy needs option 'session'"));
}

/// Every option that is typed is a field of the one list.
TEST(SyncStage, TheListHasEveryOption) {
  SyncOptions options;
  std::vector<std::string> names;
  VisitFields([&](const std::string& name, const auto&, const std::string&) { names.push_back(name); }, options);
  for (const char* name :
       {"calib", "pose2d", "normalized", "session", "project", "from", "fps,frame-rate", "min-frames", "out"})
    EXPECT_THAT(names, ::testing::Contains(name));
}

}  // namespace
}  // namespace mvstudio::stages
