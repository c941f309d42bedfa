#include "calib/covariance/board_errors.h"

#include <cmath>

#include "calib/covariance/uncertainty.h"
#include "calib/lens/lens_pool.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

struct Solved {
  LensPool pool;
  double focal_error_px = 0;
};

/// One camera's boards with independent noise, each bent by the hand that holds it by `bend_m` in the middle (one sigma).
Solved SolvedWith(double bend_m, int num_frames, uint64_t seed, LensModel model = LensModel::kBrown2) {
  testing::SceneOptions options;
  options.num_cameras = 1, options.num_frames = num_frames, options.model = model, options.noise_px = 0.1, options.seed = seed;
  testing::Scene scene = testing::MakeScene(options);
  const geometry::Projector projector(scene.truth.cameras[0]);
  Rng hand(seed + 7), noise(seed + 9);
  std::vector<int64_t> frames;
  std::vector<View> views = MakeViews({scene.board}, scene.detections, &frames);
  for (View& view : views) {
    const double bend = bend_m * hand.Normal();
    const geometry::Rigid3 cam_from_world = scene.truth.cam_from_world[0];
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      const Eigen::Vector3d x = view.x_in_board.col(i) + Eigen::Vector3d(0, 0, bend * view.warp_basis(0, i));
      const Eigen::Vector3d x_in_cam = cam_from_world * (scene.truth.world_from_board[static_cast<size_t>(view.frame)] * x);
      view.px.col(i) = projector.Project(x_in_cam).px + 0.1 * Eigen::Vector2d(noise.Normal(), noise.Normal());
    }
  }
  BundleOptions bundle;
  bundle.reject_outliers = false;
  Solved solved;
  solved.pool = MakePool({CalibrateMono(testing::MakeCamera("c0", model), views, bundle, true)}, {0}, 1);
  solved.focal_error_px = solved.pool.state.cameras[0].fx() - scene.truth.cameras[0].fx();
  return solved;
}

double RatioOf(const LensPool& pool) { return VarianceByBoards(pool.views, pool.cluster, pool.state)[0]; }

TEST(VarianceByBoards, IndependentCornersKeepTheirs) {
  int larger = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const double ratio = RatioOf(SolvedWith(0, seed % 2 ? 8 : 20, seed).pool);
    larger += ratio > 1;
    EXPECT_LT(ratio, 2.5) << seed;
  }
  EXPECT_LE(larger, 3) << "2.5 standard deviations";
}

/// The errors of the focal length in their own standard deviations, over many recordings of bent boards.
TEST(VarianceByBoards, BoardsBentByHandSayHowFarTheLensIsOff) {
  double by_corners = 0, by_boards = 0;
  constexpr int kRecordings = 16;
  for (uint64_t seed = 1; seed <= kRecordings; ++seed) {
    const Solved solved = SolvedWith(0.002, 12, seed);
    const LensPool& pool = solved.pool;
    std::vector<View> evidence = pool.views;
    const std::vector<double> ratio = VarianceByBoards(evidence, pool.cluster, pool.state);
    EXPECT_GT(ratio[0], 1.5) << seed;
    const BundleOptions bundle = PoolBundle(pool.config, {});
    const double sigma_px = pool.bundle.sigma_px > 0 ? pool.bundle.sigma_px : FitPool(pool, pool.config, {}).bundle.sigma_px;
    by_corners +=
        std::pow(solved.focal_error_px, 2) / ComputeCovariance(evidence, pool.state, bundle, sigma_px).params[0](0, 0);
    DiscountByBoards(ratio, &evidence);
    by_boards += std::pow(solved.focal_error_px, 2) / ComputeCovariance(evidence, pool.state, bundle, sigma_px).params[0](0, 0);
  }
  EXPECT_GT(std::sqrt(by_corners / kRecordings), 2) << "corners alone claim too much";
  EXPECT_LT(std::sqrt(by_boards / kRecordings), 1.6);
  EXPECT_GT(std::sqrt(by_boards / kRecordings), 0.5) << "nor is it claimed to be worse than it is";
}

TEST(VarianceByBoards, HeldAndSplinedLensesAndTwoBoardsHaveOne) {
  LensPool pool = SolvedWith(0.004, 12, 3).pool;
  ASSERT_GT(RatioOf(pool), 1);
  EXPECT_EQ(VarianceByBoards(pool.views, pool.cluster, pool.state, {true})[0], 1);
  const std::vector<int> two(pool.views.size(), 0);
  EXPECT_EQ(VarianceByBoards(pool.views, two, pool.state)[0], 1) << "one place";
}

}  // namespace
}  // namespace mvstudio::calib
