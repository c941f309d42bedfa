#include "calib/lens/model_selection.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

LensPool Solve(LensModel model, int num_cameras, int num_frames, double noise_px, uint64_t seed = 1, double warp_m = 0,
               double focal_step_px = 15, const Eigen::Vector2d& stretch = Eigen::Vector2d::Zero()) {
  testing::SceneOptions options;
  options.seed = seed;
  options.num_cameras = num_cameras;
  options.num_frames = num_frames;
  options.model = model;
  options.noise_px = noise_px;
  options.focal_step_px = focal_step_px;
  const auto scene = testing::MakeScene(options);
  std::vector<int64_t> frames;
  std::vector<View> views = MakeViews({scene.board}, scene.detections, &frames);
  for (View& view : views) {
    // The image of the bent, stretched board, by moving the observations by what its shape changes.
    RigState bent = scene.truth;
    bent.board_warp_m = {Eigen::Vector2d(warp_m, -warp_m / 2)};
    Eigen::Matrix3Xd corners = BentCorners(view, bent);
    Eigen::Matrix2d by_stretch;
    by_stretch << 1 + stretch.y(), stretch.x(), stretch.x(), 1 - stretch.y();
    corners.topRows<2>() = by_stretch * corners.topRows<2>();
    const auto& camera = scene.truth.cameras[view.camera_idx];
    const auto flat = ResidualsOf(view, camera, CamFromBoard(view, bent));
    view.px += *ResidualsOf(view, camera, CamFromBoard(view, bent), &corners) - *flat;
  }
  std::vector<MonoSolution> monos;
  std::vector<int> cameras;
  for (int c = 0; c < num_cameras; ++c) {
    std::vector<View> of_camera;
    for (const View& view : views) {
      if (view.camera_idx == c) of_camera.push_back(view);
    }
    monos.push_back(
        CalibrateMono(testing::MakeCamera("c" + std::to_string(c), LensModel::kBrown4), of_camera, BundleOptions()));
    cameras.push_back(c);
  }
  return MakePool(monos, cameras, 1);
}

SelectionOptions Four() {
  SelectionOptions options;
  options.folds = 4;
  return options;
}

// The rule of one standard error picks a larger model than the truth in about one of six noisy scenes, by its construction, and
// must never pick a smaller one.
TEST(ChooseLens, FindsTheModelThatMadeTheData) {
  for (LensModel model : {LensModel::kPinhole, LensModel::kBrown2, LensModel::kBrown4}) {
    int exact = 0;
    for (uint64_t seed = 1; seed <= 6; ++seed) {
      const LensChoice choice = ChooseLens(Solve(model, 1, 12, 0.05, seed), Four(), BundleOptions(), RunContext());
      ASSERT_GE(choice.index, 0);
      const LensModel chosen = choice.candidates[choice.index].config.model;
      EXPECT_GE(geometry::NumParams(chosen), geometry::NumParams(model)) << "seed " << seed << ": " << choice.reason;
      exact += chosen == model;
    }
    EXPECT_GE(exact, 4) << geometry::ToString(model);
  }
}

TEST(ChooseLens, SharesTheLensOfIdenticalCamerasOnly) {
  const LensPool same = Solve(LensModel::kBrown2, 3, 12, 0.1, 1, 0, 0);
  const LensChoice together = ChooseLens(same, Four(), BundleOptions(), RunContext());
  ASSERT_GE(together.index, 0);
  EXPECT_TRUE(together.candidates[together.index].config.shared) << together.reason;
  LensPool different = same;
  for (View& view : different.views) {
    if (view.camera_idx == 1) view.px.colwise() += Eigen::Vector2d(8, -5);  // its principal point
  }
  const LensChoice apart = ChooseLens(different, Four(), BundleOptions(), RunContext());
  ASSERT_GE(apart.index, 0);
  EXPECT_FALSE(apart.candidates[apart.index].config.shared) << apart.reason;
  // Half a percent of focal length hides in the boards' poses, but not from the lenses themselves.
  const LensChoice nearly = ChooseLens(Solve(LensModel::kBrown2, 3, 12, 0.1, 1, 0, 3), Four(), BundleOptions(), RunContext());
  ASSERT_GE(nearly.index, 0);
  EXPECT_FALSE(nearly.candidates[nearly.index].config.shared) << nearly.reason;
}

TEST(ChooseWarp, SeesABendOfTheBoardOnlyWhereThereIsOne) {
  const LensPool flat = Solve(LensModel::kBrown2, 1, 20, 0.05, 2);
  EXPECT_FALSE(
      ChooseWarp(FitPool(flat, {LensModel::kBrown2, {}, false, false}, BundleOptions()), Four(), BundleOptions(), RunContext())
          .pays);
  const LensPool bent = Solve(LensModel::kBrown2, 1, 20, 0.05, 2, 2e-3);
  const LensPool start = FitPool(bent, {LensModel::kBrown2, {}, false, false}, BundleOptions());
  EXPECT_TRUE(ChooseWarp(start, Four(), BundleOptions(), RunContext()).pays);
  const LensPool fit = FitPool(start, {LensModel::kBrown2, {}, false, true}, BundleOptions());
  EXPECT_NEAR(fit.state.board_warp_m[0].x(), 2e-3, 1e-4);
  EXPECT_NEAR(fit.state.board_warp_m[0].y(), -1e-3, 1e-4);
}

TEST(ChooseStretch, SeesAStretchOfTheBoardOnlyWhereThereIsOne) {
  int wrongly = 0;
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const LensPool square = Solve(LensModel::kBrown2, 1, 20, 0.05, seed);
    wrongly += ChooseStretch(FitPool(square, {LensModel::kBrown2, {}, false, false}, BundleOptions()), Four(), BundleOptions(),
                             RunContext())
                   .pays;
  }
  EXPECT_EQ(wrongly, 0);
  const LensPool stretched = Solve(LensModel::kBrown2, 1, 20, 0.05, 2, 0, 15, {-2e-3, 1e-3});
  const LensPool start = FitPool(stretched, {LensModel::kBrown2, {}, false, false}, BundleOptions());
  EXPECT_TRUE(ChooseStretch(start, Four(), BundleOptions(), RunContext()).pays);
  const LensPool fit = FitPool(start, {LensModel::kBrown2, {}, false, false, true}, BundleOptions());
  EXPECT_NEAR(fit.state.board_stretch[0].x(), -2e-3, 5e-5);
  EXPECT_NEAR(fit.state.board_stretch[0].y(), 1e-3, 5e-5);
  EXPECT_NEAR(fit.state.cameras[0].fx(), 540, 0.5);
  EXPECT_NEAR(fit.state.cameras[0].fy(), 540 * 1.002, 0.5);
}

TEST(ChooseLens, WithTooFewViewsToHoldOutTheBoardsThemselvesDecide) {
  const LensChoice choice = ChooseLens(Solve(LensModel::kBrown2, 1, 5, 0.05), Four(), BundleOptions(), RunContext());
  ASSERT_GE(choice.index, 0);
  EXPECT_EQ(choice.candidates[static_cast<size_t>(choice.index)].config.model, LensModel::kBrown2);
  EXPECT_NE(choice.reason.find("Schwarz's criterion"), std::string::npos) << choice.reason;
  EXPECT_NE(choice.reason.find("too few"), std::string::npos) << choice.reason;
}

TEST(HoldoutErrors, AreTheNoiseForTheRightModelAndLargerForATooSimpleOne) {
  const LensPool pool = Solve(LensModel::kBrown2, 1, 20, 0.1);
  const auto rms = [&](LensModel model) {
    const LensPool fit = FitPool(pool, {model, {}, false, false}, BundleOptions());
    return Summarize(fit, HoldoutErrors(fit, 5, 20, BundleOptions()), 0).rms_px;
  };
  const LensPool right = FitPool(pool, {LensModel::kBrown2, {}, false, false}, BundleOptions());
  EXPECT_GT(rms(LensModel::kBrown2), right.bundle.rms_px) << "held-out errors hold the error of the pose";
  EXPECT_LT(rms(LensModel::kBrown2), 1.25 * 0.1 * std::sqrt(2.0));
  EXPECT_GT(rms(LensModel::kPinhole), 2 * rms(LensModel::kBrown2));
  LensPool two = right;
  two.views.resize(2), two.prior.resize(2);
  EXPECT_EQ(HoldoutErrors(two, 5, 20, BundleOptions()).status, Status::kTooFewViews);
}

TEST(HoldoutErrors, CountGrossErrors) {
  LensPool pool = Solve(LensModel::kBrown2, 1, 12, 0.1);
  for (int v = 0; v < 6; ++v) pool.views[v].px(0, 7) += 40;
  const LensPool fit = FitPool(pool, {LensModel::kBrown2, {}, false, false}, BundleOptions());
  const HoldoutSummary s = Summarize(fit, HoldoutErrors(fit, 4, 12, BundleOptions()), 0);
  EXPECT_NEAR(s.gross_fraction * s.num_corners, 6, 0.5);
  EXPECT_LT(s.rms_px, 0.2);
}

}  // namespace
}  // namespace mvstudio::calib
