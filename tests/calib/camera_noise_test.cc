#include "calib/bundle/camera_noise.h"

#include "calib/bundle/bundle.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// Three cameras whose corners have the given standard deviations.
testing::Scene NoisyScene(const std::vector<double>& noise_px, uint64_t seed) {
  testing::SceneOptions options;
  options.num_cameras = static_cast<int>(noise_px.size());
  options.num_frames = 24;
  options.model = geometry::LensModel::kBrown2;
  testing::Scene scene = testing::MakeScene(options);
  Rng rng(seed);
  for (Detection& detection : scene.detections) {
    for (double& x : detection.points_px.reshaped()) x += noise_px[detection.camera_idx] * rng.Normal();
  }
  return scene;
}

struct Solved {
  std::vector<View> views;
  RigState state;
  BundleReport report;
};

Solved Solve(const testing::Scene& scene, bool each_camera) {
  Solved solved;
  solved.state = scene.truth;
  solved.views = MakeViews({scene.board}, scene.detections, &solved.state.frames);
  BundleOptions options;
  options.each_camera_noise = each_camera;
  solved.report = SolveBundle(&solved.views, &solved.state, options);
  return solved;
}

TEST(CameraNoise, EachCamerasSigmaIsFound) {
  const std::vector<double> truth = {0.05, 0.2, 1.0};
  const Solved solved = Solve(NoisyScene(truth, 1), true);
  ASSERT_EQ(solved.report.status, Status::kOk) << solved.report.message;
  for (size_t c = 0; c < truth.size(); ++c) EXPECT_NEAR(solved.report.camera_sigma_px[c] / truth[c], 1, 0.1) << c;
}

TEST(CameraNoise, ANoisyCameraKeepsItsCornersAndLeavesTheOthersTheirs) {
  const testing::Scene scene = NoisyScene({0.1, 0.1, 1.5}, 2);
  EXPECT_LE(Solve(scene, true).report.num_rejected, 3);
  EXPECT_GT(Solve(scene, false).report.num_rejected, 100) << "one noise for all loses corners that are as good as their camera";
}

TEST(CameraNoise, FewCornersBorrowFromTheOthers) {
  testing::Scene scene = NoisyScene({0.2, 0.2, 0.2}, 3);
  int views = 0;
  for (Detection& detection : scene.detections) {
    if (detection.camera_idx != 2 || ++views <= 1) continue;
    detection.corner_ids.clear(), detection.points_px.resize(2, 0);
  }
  RigState state = scene.truth;
  std::vector<View> all = MakeViews({scene.board}, scene.detections, &state.frames);
  std::vector<Eigen::VectorXd> distances;
  for (const View& view : all) distances.push_back(Eigen::VectorXd::Constant(view.size(), view.camera_idx == 2 ? 0.05 : 0.2));
  const CameraNoise noise = RobustNoise(distances, all, state, true);
  EXPECT_GT(noise.limit_px[2], 1.5 * 0.849 * 0.05) << "one view that happens to fit well is no proof of a quiet camera";
  EXPECT_NEAR(noise.limit_px[0], 0.849 * 0.2, 0.01);
}

TEST(CameraNoise, ExactCornersAndNoCornersAreNoTrouble) {
  testing::Scene scene = NoisyScene({0, 0, 0}, 4);
  const Solved solved = Solve(scene, true);
  EXPECT_EQ(solved.report.status, Status::kOk);
  EXPECT_EQ(solved.report.num_rejected, 0);
  const std::vector<double> none = CameraSigmas({}, {}, 1, 2);
  EXPECT_TRUE(std::isnan(none[0]) && std::isnan(none[1]));
  const CameraNoise empty = RobustNoise({}, {}, scene.truth, true);
  for (double limit : empty.limit_px) EXPECT_GT(limit, 0);
}

}  // namespace
}  // namespace mvstudio::calib
