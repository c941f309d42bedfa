#include "calib/lens/held_out_view.h"

#include <algorithm>
#include <cmath>

#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

struct Views {
  testing::Scene scene;
  RigState state;
  std::vector<View> views;
};

Views MakeNoisy(double noise_px, int seed = 1) {
  testing::SceneOptions options;
  options.noise_px = noise_px;
  options.num_frames = 30;
  options.seed = static_cast<uint64_t>(seed);
  Views out{testing::MakeScene(options), {}, {}};
  out.state = out.scene.truth;
  out.views = MakeViews({out.scene.board}, out.scene.detections, &out.state.frames);
  return out;
}

View Keep(const View& view, const std::vector<int>& which) {
  View few = view;
  few.corner_ids.clear();
  few.x_in_board = view.x_in_board(Eigen::all, which);
  few.px = view.px(Eigen::all, which);
  few.warp_basis = view.warp_basis(Eigen::all, which);
  few.weights = view.weights(which);
  for (int i : which) few.corner_ids.push_back(view.corner_ids[i]);
  return few;
}

double RmsOf(const Views& all, const std::vector<int>& corners, double* gross) {
  std::vector<double> errors;
  for (const View& view : all.views) {
    std::vector<int> which;
    for (int i : corners)
      if (i < view.size()) which.push_back(i);
    const View scored = corners.empty() ? view : Keep(view, which);
    AppendHeldOutErrors(all.state.cameras[view.camera_idx], scored, all.state, CamFromBoard(view, all.state), &errors);
  }
  double sum = 0;
  *gross = 0;
  for (double e : errors) sum += std::min(e * e, 25.0), *gross += e > 5;
  *gross /= static_cast<double>(std::max<size_t>(1, errors.size()));
  return std::sqrt(sum / static_cast<double>(errors.size()));
}

TEST(HeldOutView, WithTheTrueLensTheErrorsAreTheNoise) {
  double gross = 0;
  const double rms = RmsOf(MakeNoisy(0.3), {}, &gross);
  EXPECT_EQ(gross, 0);
  EXPECT_GT(rms, 0.3 * std::sqrt(2.0));
  EXPECT_LT(rms, 1.35 * 0.3 * std::sqrt(2.0)) << "the pose's own error adds a little";
}

TEST(HeldOutView, FewCornersSayWhatTheyCanAndNoMore) {
  for (const std::vector<int>& corners :
       {std::vector<int>{0, 4, 22, 30, 40}, {0, 8, 26, 35, 44, 20}, {0, 3, 18, 21, 30, 41, 12}}) {
    double gross = 0;
    const double rms = RmsOf(MakeNoisy(0.3), corners, &gross);
    EXPECT_EQ(gross, 0) << corners.size();
    EXPECT_NEAR(rms / (0.3 * std::sqrt(2.0)), 1, 0.3) << corners.size();
  }
}

/// Two rows of the board: half of them hardly gives a pose, which is no fault of the lens.
TEST(HeldOutView, ATwoRowStripIsNoGrossError) {
  std::vector<int> strip;
  for (int i = 0; i < 10; ++i) strip.push_back(i);
  double gross = 0;
  RmsOf(MakeNoisy(0.5), strip, &gross);
  EXPECT_LT(gross, 0.01);
}

TEST(HeldOutView, AWrongLensShows) {
  Views all = MakeNoisy(0.1);
  for (geometry::Camera& camera : all.state.cameras) camera.params.tail(camera.params.size() - 4).setZero();
  double gross = 0;
  EXPECT_GT(RmsOf(all, {}, &gross), 4 * 0.1 * std::sqrt(2.0));
}

TEST(HeldOutView, ABoardWithoutAPoseHasInfiniteErrors) {
  Views all = MakeNoisy(0.1);
  View& view = all.views[0];
  view.px.row(1).setConstant(100);
  std::vector<double> errors;
  AppendHeldOutErrors(all.state.cameras[0], view, all.state, geometry::Rigid3(), &errors);
  ASSERT_FALSE(errors.empty());
  EXPECT_GT(*std::max_element(errors.begin(), errors.end()), 5);
}

}  // namespace
}  // namespace mvstudio::calib
