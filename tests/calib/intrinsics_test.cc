#include "calib/intrinsics.h"

#include <gtest/gtest.h>

#include "tests/calib/synthetic.h"

namespace mvstudio::calib {
namespace {

using testing::MakeScene;
using testing::SceneOptions;

std::vector<View> ViewsOf(const testing::Scene& scene, std::vector<int64_t>* frames) {
  return MakeViews({scene.board}, scene.detections, frames);
}

TEST(GuessFocal, ClosedFormIsExactForAPinholeAtTheCentre) {
  SceneOptions options;
  options.num_cameras = 1;
  testing::Scene scene = MakeScene(options);
  scene.truth.cameras[0] = geometry::MakePinhole("c", 640, 480, 700);
  scene.detections.clear();
  Rng rng(1);
  for (int f = 0; f < 6; ++f) scene.detections.push_back(testing::Observe(scene, 0, f, 0, &rng));
  std::vector<int64_t> frames;
  const FocalGuess guess = GuessFocal(ViewsOf(scene, &frames), 640, 480);
  ASSERT_EQ(guess.status, Status::kOk);
  EXPECT_NEAR(guess.focal_px, 700, 1e-6);
}

TEST(GuessFocal, FrontoParallelBoardsAreDegenerate) {
  SceneOptions options;
  options.num_cameras = 1;
  options.max_tilt_rad = 0;
  options.model = geometry::LensModel::kPinhole;
  std::vector<int64_t> frames;
  EXPECT_EQ(GuessFocal(ViewsOf(MakeScene(options), &frames), 640, 480).status, Status::kDegenerate);
  EXPECT_EQ(GuessFocal({}, 640, 480).status, Status::kTooFewViews);
}

class CalibrateMonoTest : public ::testing::TestWithParam<geometry::LensModel> {};

TEST_P(CalibrateMonoTest, RecoversNoiseFreeIntrinsics) {
  SceneOptions options;
  options.num_cameras = 1;
  options.num_frames = 12;
  options.model = GetParam();
  const auto scene = MakeScene(options);
  geometry::Camera start = scene.truth.cameras[0];
  start.params.setZero();
  std::vector<int64_t> frames;
  const std::vector<View> views = ViewsOf(scene, &frames);
  const MonoSolution solution = CalibrateMono(start, views, frames, BundleOptions());
  ASSERT_EQ(solution.status, Status::kOk) << solution.message;
  EXPECT_LT(solution.bundle.rms_px, 1e-7);
  const Eigen::VectorXd error = solution.state.cameras[0].params - scene.truth.cameras[0].params;
  EXPECT_LT((error.array() / scene.truth.cameras[0].params.array().abs().max(1.0)).abs().maxCoeff(), 1e-6) << error.transpose();
}

INSTANTIATE_TEST_SUITE_P(Models, CalibrateMonoTest,
                         ::testing::Values(geometry::LensModel::kPinhole, geometry::LensModel::kBrown1,
                                           geometry::LensModel::kBrown2, geometry::LensModel::kBrown4,
                                           geometry::LensModel::kBrown5, geometry::LensModel::kKannalaBrandt4));

TEST(CalibrateMono, NothingAndNanHaveAStatus) {
  const auto scene = MakeScene({});
  const geometry::Camera camera = scene.truth.cameras[0];
  EXPECT_EQ(CalibrateMono(camera, {}, {}, BundleOptions()).status, Status::kTooFewViews);
  std::vector<int64_t> frames;
  std::vector<View> views = ViewsOf(scene, &frames);
  views[2].px(0, 0) = std::nan("");
  EXPECT_EQ(CalibrateMono(camera, views, frames, BundleOptions()).status, Status::kNonFiniteInput);
}

TEST(WithModel, KeepsWhatBothHave) {
  const geometry::Camera brown5 = testing::MakeCamera("c", geometry::LensModel::kBrown5);
  EXPECT_EQ(WithModel(brown5, geometry::LensModel::kBrown2).params, brown5.params.head(6));
  const geometry::Camera rational = WithModel(brown5, geometry::LensModel::kRational8);
  EXPECT_EQ(rational.params.head(9), brown5.params);
  EXPECT_EQ(rational.params.tail(3).norm(), 0);
  EXPECT_EQ(WithModel(brown5, geometry::LensModel::kKannalaBrandt4).params.tail(4).norm(), 0);
}

}  // namespace
}  // namespace mvstudio::calib
