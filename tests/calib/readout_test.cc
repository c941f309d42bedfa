#include "calib/rig/readout.h"

#include <cmath>

#include "calib/bundle/bundle.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// Boards that swing in front of the cameras, a frame every 1/30 s or so; camera 1 reads its rows over `readout` of a frame.
testing::Scene Swinging(double readout, double speed, double noise_px, uint64_t seed) {
  testing::SceneOptions options;
  options.num_cameras = 3;
  options.num_frames = 120;
  options.model = geometry::LensModel::kBrown2;
  testing::Scene scene = testing::MakeScene(options);
  const auto board_at = [&](double frame) {
    const double t = speed * frame;
    geometry::Rigid3 pose;
    pose.rotation =
        geometry::RotationExp(Eigen::Vector3d(M_PI / 2 + 0.4 * std::sin(t), 0.5 * std::sin(1.3 * t), 0.4 * std::sin(0.7 * t)));
    pose.translation =
        Eigen::Vector3d(0.25 * std::sin(1.1 * t) - 0.24, 0.3 * std::sin(0.9 * t), 0.2 * std::sin(1.7 * t) + 0.15);
    return pose;
  };
  Rng rng(seed);
  scene.detections.clear();
  for (int f = 0; f < options.num_frames; ++f) {
    scene.truth.frames[f] = f;
    scene.truth.world_from_board[f] = board_at(f);
    for (int c = 0; c < options.num_cameras; ++c) {
      Detection detection = testing::Observe(scene, c, f, 0, &rng);
      testing::Scene moment = scene;
      for (Eigen::Index i = 0; i < detection.points_px.cols() && c == 1; ++i) {
        const double row = detection.points_px(1, i) / 479 - 0.5;
        const Eigen::Vector3d x = CornersInBoard(scene.board).col(detection.corner_ids[i]);
        const geometry::Projector projector(scene.truth.cameras[c]);
        detection.points_px.col(i) = projector.Project(scene.truth.cam_from_world[c] * (board_at(f + readout * row) * x)).px;
      }
      for (double& value : detection.points_px.reshaped()) value += noise_px * rng.Normal();
      if (detection.num_corners() > 0) scene.detections.push_back(detection);
    }
  }
  return scene;
}

std::vector<Readout> Estimate(const testing::Scene& scene) {
  RigState state = scene.truth;
  std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
  const BundleReport report = SolveBundle(&views, &state, {});
  EXPECT_TRUE(report.status == Status::kOk || report.status == Status::kNotConverged) << report.message;
  return EstimateReadout(views, state, report.sigma_px);
}

TEST(Readout, ARollingShutterIsMeasured) {
  for (const double truth : {0.8, 0.3, -0.5}) {
    const std::vector<Readout> readouts = Estimate(Swinging(truth, 0.15, 0.2, 1));
    EXPECT_NEAR(readouts[1].frames, truth, 0.1 * std::abs(truth) + 4 * readouts[1].sigma_frames);
    EXPECT_GT(std::abs(readouts[1].frames), 5 * readouts[1].sigma_frames);
    EXPECT_GT(readouts[1].shift_px, 0.2);
  }
}

TEST(Readout, GlobalShuttersHaveNone) {
  int beyond = 0;
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    for (const Readout& readout : Estimate(Swinging(0, 0.15, 0.2, seed)))
      beyond += std::abs(readout.frames) > 3 * readout.sigma_frames;
  }
  EXPECT_LE(beyond, 1) << "of 30";
}

TEST(Readout, BoardsThatStandStillOrHaveNoNeighboursSayNothing) {
  testing::Scene still = Swinging(0, 0, 0.2, 1), apart = Swinging(0, 0.15, 0.2, 1);
  for (int64_t& frame : apart.truth.frames) frame *= 100;
  for (Detection& detection : apart.detections) detection.frame_idx *= 100;
  for (const Readout& readout : Estimate(apart)) EXPECT_TRUE(std::isinf(readout.sigma_frames));
  for (const Readout& readout : Estimate(still)) {
    EXPECT_LT(readout.shift_px, 0.1);
    EXPECT_FALSE(std::isnan(readout.frames));
  }
}

}  // namespace
}  // namespace mvstudio::calib
