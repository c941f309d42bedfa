#include <algorithm>

#include "calib/calibrate.h"
#include "calib/covariance/projection_uncertainty.h"
#include "calib/rig/board_metrics.h"
#include "tests/calib/filmed.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

/// Cameras whose images of one frame were taken at different time steps of a board that moves.
namespace mvstudio::calib {
namespace {

CalibrateOptions Given() {
  CalibrateOptions options;
  options.model = geometry::LensModel::kBrown4;
  options.holdout = {4, 3};
  return options;
}

TEST(EstimateMotion, ConstantMotionIsExactAlsoWhereABoardIsNotSeen) {
  Scene scene = testing::MakeScene({});
  RigState& state = scene.truth;
  geometry::Vector6d velocity;
  velocity << 0.03, -0.02, 0.05, 0.01, 0.02, -0.01;
  const geometry::Rigid3 first = state.world_from_board[0];
  for (size_t f = 0; f < state.frames.size(); ++f) {
    state.frames[f] = static_cast<int64_t>(f);
    state.world_from_board[f] = geometry::Perturb(static_cast<double>(f) * velocity, first);
  }
  std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
  for (size_t f = 0; f < state.frames.size(); ++f) state.frames[f] = static_cast<int64_t>(f);
  const std::vector<geometry::Rigid3> truth = state.world_from_board;
  for (View& view : views) {
    if (view.frame % 4 == 0) view.weights.setZero(), state.world_from_board[view.frame] = geometry::Rigid3();
  }
  EstimateMotion(views, &state);
  for (size_t f = 0; f < state.frames.size(); ++f) {
    EXPECT_LT((state.board_velocity[f] - velocity).norm(), 1e-12) << "frame " << f;
    EXPECT_LT((state.world_from_board[f].translation - truth[f].translation).norm(), 1e-12) << "frame " << f;
    EXPECT_LT(state.world_from_board[f].rotation.angularDistance(truth[f].rotation), 1e-7) << "frame " << f;
  }
}

TEST(EstimateMotion, FourNeighboursFollowAQuartic) {
  Scene scene = testing::MakeScene({});
  RigState& state = scene.truth;
  const std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
  const geometry::Rigid3 first = state.world_from_board[0];
  const auto pose_at = [&](double t) {
    geometry::Rigid3 pose = first;
    pose.translation += Eigen::Vector3d(1e-3 * t + 1e-6 * t * t * t, -2e-5 * t * t, 1e-8 * t * t * t * t);
    return pose;
  };
  for (size_t f = 0; f < state.frames.size(); ++f) {
    state.frames[f] = static_cast<int64_t>(8 * f);
    state.world_from_board[f] = pose_at(static_cast<double>(state.frames[f]));
  }
  state.motion = {16, 2};
  EstimateMotion(views, &state);
  for (size_t f = 2; f + 2 < state.frames.size(); ++f) {
    const double t = static_cast<double>(state.frames[f]);
    const Eigen::Vector3d velocity(1e-3 + 3e-6 * t * t, -4e-5 * t, 4e-8 * t * t * t);
    EXPECT_LT((state.board_velocity[f].tail<3>() - velocity).norm(), 1e-10) << f;
  }
}

TEST(EstimateMotion, ConstantAccelerationIsExactAlsoWithAFrameMissing) {
  Scene scene = testing::MakeScene({});
  RigState& state = scene.truth;
  geometry::Vector6d velocity, acceleration;
  velocity << 0, 0, 0.05, 0.01, 0.02, -0.01;
  acceleration << 0, 0, -0.01, 0.004, -0.002, 0.003;
  const std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
  const geometry::Rigid3 first = state.world_from_board[0];
  const auto pose_at = [&](double t) { return geometry::Perturb(t * velocity + t * t / 2 * acceleration, first); };
  for (size_t f = 0; f < state.frames.size(); ++f) {
    state.frames[f] = static_cast<int64_t>(f + (f > 5));  // number 6 is missing
    state.world_from_board[f] = pose_at(static_cast<double>(state.frames[f]));
  }
  EstimateMotion(views, &state);
  state.time_offset_frames = {0, 0.7};
  for (size_t f = 1; f + 1 < state.frames.size(); ++f) {
    const geometry::Rigid3 late = BoardMotion(1, static_cast<int>(f), state) * state.world_from_board[f],
                           truth = pose_at(static_cast<double>(state.frames[f]) + 0.7);
    EXPECT_LT((late.translation - truth.translation).norm(), 1e-12) << f;
    EXPECT_LT(late.rotation.angularDistance(truth.rotation), 1e-7) << f;
  }
}

/// Corners moved by half a frame measure the board as well as those of one time step.
TEST(TimeOffset, BoardMetricsTakeTheMotionAway) {
  const Scene scene = Film({0, 0.5, -0.3}, 30, 0);
  RigState state = scene.truth;
  const std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
  const BoardMetrics apart = ComputeBoardMetrics({scene.board}, views, state);
  EstimateMotion(views, &state);
  state.time_offset_frames = {0, 0.5, -0.3};
  const BoardMetrics together = ComputeBoardMetrics({scene.board}, views, state);
  EXPECT_GT(apart.reprojection_rms_px, 1);
  EXPECT_LT(together.reprojection_rms_px, 0.02) << "what is left is how the board's acceleration changes";
  EXPECT_LT(together.pair_rms_mm, 0.2 * apart.pair_rms_mm);
}

TEST(TimeOffset, IsFoundByItself) {
  const std::vector<double> late = {0, -0.4, 0.2};
  const Scene scene = Film(late, 48, 0.2);
  const CalibrateReport report = Calibrate(testing::ToInput(scene), Given(), RunContext());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(report.cameras[c].time_offset_frames, late[c], 0.02) << report.time_reason;
    EXPECT_NEAR(report.cameras[c].focal_px, scene.truth.cameras[c].fx() * 1.001, 2);
  }
  EXPECT_LT(report.rig_holdout_rms_px, 0.4);
  EXPECT_LT(report.board_metrics.reprojection_rms_px, 0.3);
  CalibrateOptions none = Given();
  none.time_offset = TimeOffsetChoice::kNone;
  const CalibrateReport without = Calibrate(testing::ToInput(scene), none, RunContext());
  EXPECT_GT(without.rig_holdout_rms_px, 3 * report.rig_holdout_rms_px);
  // The noise of the corners alone, triangulated with the true rig at one time step.
  const Scene together = Film({0, 0, 0}, 48, 0.2);
  RigState truth = together.truth;
  const double floor_mm =
      ComputeBoardMetrics({together.board}, MakeViews({together.board}, together.detections, &truth.frames), truth).pair_rms_mm;
  EXPECT_LT(report.board_metrics.pair_rms_mm, 1.1 * floor_mm);
  EXPECT_GT(without.board_metrics.pair_rms_mm, 1.2 * floor_mm);
}

TEST(TimeOffset, IsLeftOutWhereCamerasAreSynchronous) {
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    const Scene scene = Film({0, 0, 0}, 32, 0.3, seed);
    const CalibrateReport report = Calibrate(testing::ToInput(scene), Given(), RunContext());
    ASSERT_EQ(report.status, Status::kOk) << report.message;
    EXPECT_NE(report.time_reason.find("left out"), std::string::npos) << report.time_reason;
    for (const CameraReport& camera : report.cameras) EXPECT_EQ(camera.time_offset_frames, 0);
  }
}

/// A clock that falls behind by `rate`: found, counted, named, and taken for no motion.
void ExpectDriftFound(const Scene& scene, double rate) {
  CalibrateOptions options = Given();
  options.motions = true;
  const CalibrateReport report = Calibrate(testing::ToInput(scene), options, RunContext());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_NEAR(report.cameras[1].time_rate, rate, 0.1 * rate) << report.time_reason;
  EXPECT_NEAR(report.cameras[1].focal_px, scene.truth.cameras[1].fx() * 1.001, 3);
  EXPECT_TRUE(HasReason(report, "CAL-CLOCK"));
  for (const char* code : {"CAL-MOVED", "CAL-LENSCHANGED", "CAL-UNEXPLAINED", "CAL-LATE"})
    EXPECT_FALSE(HasReason(report, code)) << code;
  const geometry::TimeOffset stated = report.rig.cameras[1].time_offset.value();
  const geometry::TimeOffset reference = report.rig.cameras[0].time_offset.value();
  for (const int64_t frame : {scene.truth.frames.front(), scene.truth.frames.back()}) {
    const double late = rate * static_cast<double>(frame - 10);
    EXPECT_NEAR(stated.At(static_cast<double>(frame)) - reference.At(static_cast<double>(frame)), -late, 0.05) << frame;
  }
  EXPECT_GT(stated.sigma_rate, 0);
}

TEST(TimeOffset, AClockThatDriftsIsFoundByItself) { ExpectDriftFound(Film({0, 0, 0}, 48, 0.2, 1, {0, 0.01, 0}), 0.01); }

TEST(TimeOffset, AClockThatDriftsIsFoundInEveryFourthFrame) {
  ExpectDriftFound(Film({0, 0, 0}, 48, 0.2, 1, {0, 0.005, 0}, 4), 0.005);
}

/// Boards that were put down say nothing of clocks, whatever their frames' numbers.
TEST(TimeOffset, BoardsAtRestHaveNone) {
  for (const int stride : {1, 8}) {
    testing::SceneOptions options;
    options.num_cameras = 2, options.num_frames = 24, options.noise_px = 0.3, options.model = geometry::LensModel::kBrown2;
    Scene scene = testing::MakeScene(options);
    for (Detection& d : scene.detections) d.frame_idx *= stride;
    CalibrateOptions automatic = testing::PlainOptions();
    automatic.time_offset = TimeOffsetChoice::kAuto;
    const CalibrateReport report = Calibrate(testing::ToInput(scene), automatic, RunContext());
    ASSERT_EQ(report.status, Status::kOk) << report.message;
    for (const CameraReport& camera : report.cameras)
      EXPECT_TRUE(camera.time_offset_frames == 0 && camera.time_rate == 0) << report.time_reason;
  }
}

TEST(TimeOffset, OfWholeFramesMovesTheNumbersWithAWarning) {
  Scene scene = Film({0, 0, 0}, 48, 0.2);
  for (Detection& d : scene.detections) d.frame_idx += d.camera_idx == 2 ? 7 : 0;
  const CalibrateReport report = Calibrate(testing::ToInput(scene), Given(), RunContext());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_EQ(report.frame_shift, (std::vector<int64_t>{0, 0, -7}));
  EXPECT_LT(report.rig_holdout_rms_px, 0.4);
  const auto& reasons = report.verdict.reasons;
  EXPECT_TRUE(std::any_of(reasons.begin(), reasons.end(), [](const auto& reason) { return reason.code == "CAL-FRAMES"; }));
  CalibrateOptions none = Given();
  none.time_offset = TimeOffsetChoice::kNone;
  EXPECT_EQ(Calibrate(testing::ToInput(scene), none, RunContext()).status, Status::kDegenerate);
}

/// Projections scatter by as much as is said when offsets in time are unknowns: errors of points at rest against the boards of
/// the frames' time steps.
TEST(TimeOffset, ProjectionUncertaintyCountsThem) {
  constexpr int kDraws = 60;
  constexpr double kNoise = 0.2;
  const Scene scene = Film({0, 0, 0}, 24, 0);
  RigState truth = scene.truth;
  const std::vector<View> views = MakeViews({scene.board}, scene.detections, &truth.frames);
  truth.time_offset_frames = {0, 0, 0};
  EstimateMotion(views, &truth);
  BundleOptions options;
  options.reject_outliers = false, options.refine_time = true;
  const ProjectionUncertainty uncertainty(views, truth, options, kNoise);
  const Eigen::Vector2d px(320, 240);
  const Eigen::Vector3d ray = geometry::Unproject(truth.cameras[1], px).ray_in_cam;
  const Eigen::Vector3d x_in_world = geometry::Inverse(truth.cam_from_world[1]) * (1.2 * ray);
  Eigen::Matrix2d sampled = Eigen::Matrix2d::Zero();
  Rng rng(5);
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<View> noisy = views;
    for (View& view : noisy) {
      for (double& coordinate : view.px.reshaped()) coordinate += kNoise * rng.Normal();
    }
    RigState state = truth;
    ASSERT_EQ(SolveBundle(&noisy, &state, options).status, Status::kOk);
    Eigen::Vector3d carried = Eigen::Vector3d::Zero();
    for (size_t f = 0; f < truth.frames.size(); ++f)
      carried += state.world_from_board[f] * (geometry::Inverse(truth.world_from_board[f]) * x_in_world);
    carried /= static_cast<double>(truth.frames.size());
    const Eigen::Vector2d error = geometry::Project(state.cameras[1], state.cam_from_world[1] * carried).px - px;
    sampled += error * error.transpose() / kDraws;
  }
  const PixelUncertainty found = uncertainty.PixelCovariance(1, px, 1.2);
  ASSERT_EQ(found.status, Status::kOk);
  // 120 squares of variance 1: 1 +- 0.13; 3.5 of these.
  EXPECT_NEAR((found.covariance_px2.inverse() * sampled).trace() / 2, 1, 0.45);
}

}  // namespace
}  // namespace mvstudio::calib
