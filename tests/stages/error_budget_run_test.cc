#include <cmath>
#include <fstream>

#include "core/error.h"
#include "dataset/pose/pose2d.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig_io.h"
#include "stages/error_budget/describe.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"
#include "tests/triangulate/support.h"

/// Files in, shares out, without the program.
namespace mvstudio::stages {
namespace {

/// Four cameras of a ring, 25 joints that move, exact 3D joints beside noisy 2D joints; cam_2's stated pose is `deg` off.
ErrorBudgetOptions MakeTake(const TempDir& folder, double deg) {
  geometry::Rig rig = triangulate::MakeRing(4);
  geometry::WriteRig(rig, folder / "truth.json");
  const geometry::Skeleton skeleton = geometry::SkeletonByName("body25");
  dataset::Pose3d truth;
  truth.skeleton = skeleton.name;
  ErrorBudgetOptions options;
  Rng rng(2);
  std::vector<dataset::Pose2dTrack> tracks(4);
  for (int f = 0; f < 20; ++f) {
    for (int j = 0; j < 25; ++j) {
      const double t = f / 30.0;
      const Eigen::Vector3d x(0.3 * std::cos(2.4 * j) + 0.2 * std::sin(2.1 * t + j), 0.3 * std::sin(2.4 * j),
                              0.06 * j - 0.7 + 0.1 * std::sin(3.7 * t + 2 * j));
      dataset::JointRow row;
      row.frame = f, row.joint = skeleton.joints[static_cast<size_t>(j)], row.status = Status::kOk, row.x_in_world = x;
      truth.rows.push_back(row);
      for (size_t c = 0; c < 4; ++c) {
        const auto at = geometry::Project(rig.cameras[c].camera, rig.cameras[c].cam_from_world * x);
        tracks[c].frames[f].resize(1);
        tracks[c].frames[f][0].keypoints.push_back({at.px.x() + 0.3 * rng.Normal(), at.px.y() + 0.3 * rng.Normal(), 0.9});
      }
    }
  }
  for (size_t c = 0; c < 4; ++c) {
    tracks[c].camera = rig.cameras[c].camera.name;
    dataset::WriteOpenPoseFolder(tracks[c], folder / tracks[c].camera);
    options.pose.pose2d.push_back({tracks[c].camera, folder / tracks[c].camera});
  }
  dataset::WritePose3d(truth, folder / "points");
  geometry::Rigid3& pose = rig.cameras[2].cam_from_world;
  pose = geometry::Rigid3{geometry::RotationExp({0, DegToRad(deg), 0})} * pose;
  geometry::WriteRig(rig, folder / "calibration.json");
  options.pose.calib = folder / "calibration.json", options.out = folder / "budget";
  options.truth = folder / "points", options.truth_calib = folder / "truth.json";
  return options;
}

TEST(ErrorBudgetStage, NamesTheCameraWhosePoseIsOff) {
  const TempDir folder;
  const ErrorBudgetReport report = RunErrorBudget(MakeTake(folder, 0.3));
  ASSERT_TRUE(report.budget);
  EXPECT_EQ(report.budget->joints_mm.num, 500);
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitOk);
  EXPECT_EQ(said.metrics["next"], "calibration");
  EXPECT_THAT(said.text, HasSubstr("improve next: calibration"));
  EXPECT_THAT(said.text, HasSubstr("most of one camera: cam_2"));
  std::ifstream page(report.page);
  const std::string html{std::istreambuf_iterator<char>(page), {}};
  EXPECT_THAT(html, HasSubstr("<svg"));
  EXPECT_THAT(html, HasSubstr("synchronisation"));
}

TEST(ErrorBudgetStage, WithoutTruthTheRestIsTheShiftedCamera) {
  const TempDir folder;
  ErrorBudgetOptions options = MakeTake(folder, 0.3);
  options.stated = true, options.seeds = 2;
  const ErrorBudgetReport report = RunErrorBudget(options);
  ASSERT_TRUE(report.stated);
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitOk);
  EXPECT_THAT(said.text, HasSubstr("states no sigma"));
  EXPECT_GT(said.metrics["rest_px2"].get<double>(), 0);
}

TEST(ErrorBudgetStage, ReliabilityOfEachStageThatStatesSigmas) {
  const TempDir folder;
  ErrorBudgetOptions options = MakeTake(folder, 0);
  options.reliability = true;
  const ErrorBudgetReport report = RunErrorBudget(options);
  ASSERT_EQ(report.reliability.size(), 5u);
  EXPECT_EQ(report.reliability[0].is.num, 0);  // no covariance
  EXPECT_EQ(report.reliability[2].is.num, 4 * 500 * 2);
  EXPECT_LT(report.reliability[2].is.error, 0.05);
  EXPECT_LT(report.reliability[3].is.error, 0.05);
  EXPECT_THAT(Describe(report).text, HasSubstr("none: the calibration states no covariance"));
}

TEST(ErrorBudgetStage, RefusesHalfATruth) {
  const TempDir folder;
  ErrorBudgetOptions options = MakeTake(folder, 0);
  options.truth_calib.clear();
  EXPECT_THAT(MessageOf<UsageError>([&] { RunErrorBudget(options); }), HasSubstr("give the truth whole"));
  options.truth.clear(), options.reliability = true;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunErrorBudget(options); }), HasSubstr("needs the truth"));
  options.reliability = false, options.seeds = 0;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunErrorBudget(options); }), HasSubstr("option 'seeds'"));
}

}  // namespace
}  // namespace mvstudio::stages
