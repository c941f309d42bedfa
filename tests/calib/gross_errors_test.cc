#include "calib/lens/gross_errors.h"

#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

std::vector<View> Views(double noise_px, geometry::LensModel model) {
  testing::SceneOptions options;
  options.noise_px = noise_px;
  options.model = model;
  options.focal_px = geometry::IsWide(model) ? 260 : 540;
  const testing::Scene scene = testing::MakeScene(options);
  std::vector<int64_t> frames;
  return MakeViews({scene.board}, scene.detections, &frames);
}

TEST(ScreenView, LeavesGoodViewsAlone) {
  using geometry::LensModel;
  for (LensModel model : {LensModel::kPinhole, LensModel::kBrown4, LensModel::kKannalaBrandt4, LensModel::kUcm}) {
    for (View& view : Views(0.5, model)) {
      EXPECT_EQ(ScreenView(&view), 0) << geometry::ToString(model);
      EXPECT_EQ(view.weights.minCoeff(), 1);
    }
  }
}

TEST(ScreenView, FindsUpToHalfOfTheCorners) {
  for (double share : {0.02, 0.3, 0.49}) {
    Rng rng(5);
    int spoiled = 0, found = 0, lost = 0, corners = 0;
    for (View& view : Views(0.2, geometry::LensModel::kBrown4)) {
      std::vector<bool> far(view.size(), false);
      for (Eigen::Index i = 0; i < view.size(); ++i) {
        if (rng.Uniform() >= share) continue;
        const Eigen::Vector2d anywhere(rng.Uniform(0, 639), rng.Uniform(0, 479));
        far[i] = (anywhere - view.px.col(i)).norm() > 40;
        view.px.col(i) = anywhere;
      }
      ScreenView(&view);
      for (Eigen::Index i = 0; i < view.size(); ++i) {
        spoiled += far[i], found += far[i] && view.weights[i] == 0;
        lost += !far[i] && view.weights[i] == 0, ++corners;
      }
    }
    EXPECT_GT(spoiled, 0.8 * share * corners);
    EXPECT_EQ(found, spoiled) << share;
    EXPECT_LT(lost, 0.03 * corners) << share;
  }
}

TEST(ScreenView, KeepsItsHandsOffNoiseAndTinyViews) {
  std::vector<View> views = Views(0, geometry::LensModel::kPinhole);
  View noise = views[0];
  Rng rng(6);
  for (double& coordinate : noise.px.reshaped()) coordinate = rng.Uniform(0, 480);
  EXPECT_EQ(ScreenView(&noise), 0) << "nothing agrees with anything";
  View few = HalfOf(views[0], 0);
  few.weights.tail(few.size() - 5).setZero();
  EXPECT_EQ(ScreenView(&few), 0);
  View bad = views[0];
  bad.px(0, 0) = std::nan("");
  EXPECT_EQ(ScreenView(&bad), 0);
  View line = views[0];
  line.x_in_board.row(1).setZero();
  ScreenView(&line);
  EXPECT_TRUE(line.weights.allFinite());
}

TEST(ScreenView, SameViewSameAnswer) {
  std::vector<View> views = Views(0.2, geometry::LensModel::kBrown4);
  for (Eigen::Index i = 0; i < 20; ++i) views[0].px.col(i) += Eigen::Vector2d(60 + i, -90);
  View again = views[0];
  ScreenView(&views[0]);
  ScreenView(&again);
  EXPECT_EQ(views[0].weights, again.weights);
}

}  // namespace
}  // namespace mvstudio::calib
