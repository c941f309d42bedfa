#include <gtest/gtest.h>

#include "calib/model_selection.h"
#include "tests/calib/synthetic.h"

namespace mvstudio::calib {
namespace {

MonoSolution Solve(geometry::LensModel model, int num_frames, double noise_px, uint64_t seed = 1) {
  testing::SceneOptions options;
  options.seed = seed;
  options.num_cameras = 1;
  options.num_frames = num_frames;
  options.model = model;
  options.noise_px = noise_px;
  const auto scene = testing::MakeScene(options);
  std::vector<int64_t> frames;
  const std::vector<View> views = MakeViews({scene.board}, scene.detections, &frames);
  return CalibrateMono(testing::MakeCamera("c", geometry::LensModel::kBrown4), views, frames, BundleOptions());
}

// The rule of one standard error picks a larger model than the truth in about one of six noisy scenes, by its construction, and
// must never pick a smaller one.
TEST(ChooseModel, FindsTheModelThatMadeTheData) {
  for (geometry::LensModel model :
       {geometry::LensModel::kPinhole, geometry::LensModel::kBrown2, geometry::LensModel::kBrown4}) {
    int exact = 0;
    for (uint64_t seed = 1; seed <= 6; ++seed) {
      const ModelChoice choice = ChooseModel({Solve(model, 12, 0.05, seed)}, 4, 12, 1);
      EXPECT_GE(geometry::NumParams(choice.model), geometry::NumParams(model)) << "seed " << seed << ": " << choice.reason;
      EXPECT_GE(choice.index, 0);
      exact += choice.model == model;
    }
    EXPECT_GE(exact, 4) << geometry::ToString(model);
  }
}

TEST(ChooseModel, FallsBackWithFewViews) {
  const ModelChoice choice = ChooseModel({Solve(geometry::LensModel::kBrown2, 5, 0.05)}, 4, 12, 1);
  EXPECT_EQ(choice.model, geometry::LensModel::kBrown4);
  EXPECT_EQ(choice.index, -1);
}

TEST(HoldoutError, IsTheNoiseForTheRightModelAndLargerForATooSimpleOne) {
  const MonoSolution solution = Solve(geometry::LensModel::kBrown2, 20, 0.1);
  const Holdout right = HoldoutError(solution, geometry::LensModel::kBrown2, 5, 20);
  const Holdout simple = HoldoutError(solution, geometry::LensModel::kPinhole, 5, 20);
  ASSERT_EQ(right.status, Status::kOk);
  EXPECT_GT(right.rms_px, solution.bundle.rms_px) << "held-out errors hold the error of the pose";
  EXPECT_LT(right.rms_px, 1.25 * 0.1 * std::sqrt(2.0));
  EXPECT_GT(simple.rms_px, 2 * right.rms_px);
  MonoSolution two = solution;
  two.views.resize(2);
  EXPECT_EQ(HoldoutError(two, geometry::LensModel::kBrown2, 5, 20).status, Status::kTooFewViews);
}

}  // namespace
}  // namespace mvstudio::calib
