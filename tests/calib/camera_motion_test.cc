#include "calib/check/camera_motion.h"

#include "core/units.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

struct Kick {
  int camera = 1, frame = 25;  // index into the scene's frames
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero(), shift_m = Eigen::Vector3d::Zero();
  double focal_scale = 1;
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
};

testing::Scene SceneWith(const std::vector<Kick>& kicks, int cameras = 4, double noise_px = 0.3, uint64_t seed = 1) {
  testing::SceneOptions options;
  options.num_cameras = cameras;
  options.num_frames = 40;
  options.model = geometry::LensModel::kBrown2;
  options.seed = seed;
  testing::Scene scene = testing::MakeScene(options), moved = scene;
  for (const Kick& kick : kicks) {
    geometry::Rigid3& pose = moved.truth.cam_from_world[kick.camera];
    pose.rotation = geometry::RotationExp(kick.rotation_rad) * pose.rotation;
    geometry::Camera& lens = moved.truth.cameras[kick.camera];
    lens.params.head<2>() *= kick.focal_scale;
    lens.params.segment<2>(2) += kick.centre_px;
    pose.translation = geometry::RotationExp(kick.rotation_rad) * pose.translation + kick.shift_m;
  }
  testing::ObserveAll(&scene, noise_px, seed + 10);
  testing::ObserveAll(&moved, noise_px, seed + 20);
  std::vector<Detection> all;
  const auto is_moved = [&](const Detection& detection) {
    for (const Kick& kick : kicks)
      if (detection.camera_idx == kick.camera && detection.frame_idx >= scene.truth.frames[kick.frame]) return true;
    return false;
  };
  for (const Detection& detection : scene.detections)
    if (!is_moved(detection)) all.push_back(detection);
  for (const Detection& detection : moved.detections)
    if (is_moved(detection)) all.push_back(detection);
  std::stable_sort(all.begin(), all.end(), [](const Detection& a, const Detection& b) { return a.frame_idx < b.frame_idx; });
  scene.detections = all;
  return scene;
}

CalibrateReport Calibrated(const testing::Scene& scene, const CalibrateOptions& options = testing::PlainOptions()) {
  return Calibrate(testing::ToInput(scene), options, {});
}

TEST(CameraMotion, ACameraThatRotatedIsNamedWithFrameAndAngle) {
  const double angle = DegToRad(0.5);
  const CalibrateReport report = Calibrated(SceneWith({{1, 27, {0, angle, 0}}}));
  ASSERT_EQ(report.motions.size(), 1u);
  const CameraMotion& motion = report.motions[0];
  EXPECT_EQ(motion.cameras, std::vector<std::string>{"cam1"});
  EXPECT_NEAR(static_cast<double>(motion.frame_idx), 3 * 27 + 1, 6);
  EXPECT_LE(motion.last_before, motion.frame_idx);
  EXPECT_NEAR(motion.rotation_rad, angle, 3 * motion.rotation_sigma_rad + 0.02 * angle);
  EXPECT_NE(report.verdict.outcome(), Outcome::kPass);
}

/// Before and after the motion the frames belong together: they are not in doubt.
TEST(CameraMotion, ACameraThatMovedHalfwayLeavesTheFramesAlone) {
  for (const double noise_px : {0.02, 0.2}) {
    Kick kick{2, 20, {0, DegToRad(2), 0}};
    kick.shift_m << 0.15, 0, 0;
    const CalibrateReport report = Calibrated(SceneWith({kick}, 4, noise_px));
    ASSERT_EQ(report.motions.size(), 1u) << noise_px;
    EXPECT_EQ(report.motions[0].cameras, std::vector<std::string>{"cam2"});
    EXPECT_EQ(report.frames_conflict, "") << noise_px;
  }
}

TEST(CameraMotion, AMotionInTheFirstBoardsOrTheLastIsFound) {
  for (const int frame : {6, 34}) {
    const CalibrateReport report = Calibrated(SceneWith({{2, frame, {0.02, 0, 0.01}}}));
    ASSERT_FALSE(report.motions.empty()) << frame;
    EXPECT_EQ(report.motions[0].cameras, std::vector<std::string>{"cam2"}) << frame;
  }
}

TEST(CameraMotion, ALensThatWasRefocusedOrCroppedIsNoMotion) {
  Kick zoom, crop;
  zoom.focal_scale = 1.01;
  crop.centre_px = {12, -8};
  for (const Kick& kick : {zoom, crop}) {
    const CalibrateReport report = Calibrated(SceneWith({kick}));
    ASSERT_EQ(report.motions.size(), 1u);
    const CameraMotion& motion = report.motions[0];
    EXPECT_EQ(motion.cameras, std::vector<std::string>{"cam1"});
    EXPECT_EQ(motion.kind, CameraMotion::Kind::kLens);
    EXPECT_NEAR(motion.focal_scale, kick.focal_scale, 0.002);
    EXPECT_LT((motion.centre_shift_px - kick.centre_px).norm(), 2);
    EXPECT_NE(report.verdict.outcome(), Outcome::kPass);
  }
}

/// A camera whose mount gives way by `total_rad` over the recording.
testing::Scene SaggingScene(double total_rad) {
  testing::Scene scene = SceneWith({});
  std::vector<Detection> all;
  for (size_t f = 0; f < scene.truth.frames.size(); ++f) {
    testing::Scene moved = scene;
    geometry::Rigid3& pose = moved.truth.cam_from_world[1];
    const Eigen::Quaterniond turn = geometry::RotationExp(Eigen::Vector3d(0, total_rad * static_cast<double>(f) / 40, 0));
    pose.rotation = turn * pose.rotation, pose.translation = turn * pose.translation;
    testing::ObserveAll(&moved, 0.3, 100 + f);
    for (const Detection& detection : moved.detections)
      if (detection.frame_idx == scene.truth.frames[f]) all.push_back(detection);
  }
  scene.detections = all;
  return scene;
}

TEST(CameraMotion, AMountThatGivesWayIsSteady) {
  const double total = DegToRad(1.5);
  const CalibrateReport report = Calibrated(SaggingScene(total));
  ASSERT_FALSE(report.motions.empty());
  const CameraMotion& motion = report.motions[0];
  EXPECT_EQ(motion.kind, CameraMotion::Kind::kDrift);
  EXPECT_EQ(motion.cameras, std::vector<std::string>{"cam1"});
  EXPECT_NEAR(motion.rotation_rad / total, 0.9, 0.12);
  EXPECT_NE(report.verdict.outcome(), Outcome::kPass);
}

TEST(CameraMotion, AKickIsNoLens) {
  const CalibrateReport report = Calibrated(SceneWith({{1, 20, {0.004, 0.009, 0.003}, {0.002, 0, 0.004}}}));
  ASSERT_EQ(report.motions.size(), 1u);
  EXPECT_EQ(report.motions[0].kind, CameraMotion::Kind::kMoved);
}

TEST(CameraMotion, TwoCamerasAreTwoMotions) {
  const CalibrateReport report = Calibrated(SceneWith({{0, 12, {0.02, 0, 0}}, {2, 28, {0, 0, 0}, {0.03, 0, 0}}}, 5));
  std::vector<std::string> names;
  for (const CameraMotion& motion : report.motions) names.push_back(motion.cameras[0]);
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names, (std::vector<std::string>{"cam0", "cam2"}));
}

TEST(CameraMotion, OfTwoCamerasItCannotBeToldWhichMoved) {
  const CalibrateReport report = Calibrated(SceneWith({{1, 20, {0, 0.02, 0}}}, 2));
  ASSERT_EQ(report.motions.size(), 1u);
  EXPECT_EQ(report.motions[0].cameras.size(), 2u);
}

/// Lenses and poses take up most of a small motion of two cameras: what is left is below the verdict's own limits.
TEST(CameraMotion, ASmallTurnOfOneOfTwoIsFound) {
  const CalibrateReport report = Calibrated(SceneWith({{1, 20, {0, 0.004, 0}}}, 2, 0.2, 3));
  ASSERT_EQ(report.motions.size(), 1u);
  EXPECT_NEAR(static_cast<double>(report.motions[0].frame_idx), 3 * 20 + 1, 6);
  EXPECT_NE(report.verdict.outcome(), Outcome::kPass);
}

TEST(CameraMotion, ARigThatStandsStillHasNone) {
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    for (const double noise : {0.0, 0.1, 1.0}) {
      const CalibrateReport report = Calibrated(SceneWith({}, 4, noise, seed));
      EXPECT_TRUE(report.motions.empty()) << seed << " " << noise << ": " << report.motions[0].cameras[0];
    }
  }
}

TEST(CameraMotion, SplitWhereItMovedTheRigIsRight) {
  const testing::Scene scene = SceneWith({{1, 27, {0, 0.01, 0}}});
  CalibrateOptions options = testing::PlainOptions();
  options.split_at = {{"cam1", 82, false}};
  const CalibrateReport report = Calibrated(scene, options);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_TRUE(report.motions.empty());
  ASSERT_EQ(report.rig.cameras.size(), 5u);
  EXPECT_EQ(report.rig.cameras.back().camera.name, "cam1@82");
  EXPECT_EQ(report.verdict.outcome(), Outcome::kPass) << report.verdict.reasons[0].text;
  const geometry::Rig truth = testing::TruthRig(scene);
  EXPECT_LT((report.rig.cameras[1].cam_from_world.translation - truth.cameras[1].cam_from_world.translation).norm(), 0.005);
}

}  // namespace
}  // namespace mvstudio::calib
