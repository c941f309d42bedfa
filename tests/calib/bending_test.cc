#include "calib/rig/bending.h"

#include <cmath>

#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

struct Recording {
  std::vector<View> views;
  RigState state;
};

/// Boards at their true places; in every time step bent by `bend_m` times a normal number.
Recording FilmBent(double noise_px, double bend_m, uint64_t seed) {
  testing::SceneOptions options;
  options.seed = seed;
  testing::Scene scene = testing::MakeScene(options);
  testing::ObserveAll(&scene, 0, seed);
  Recording recording;
  recording.state = scene.truth;
  recording.views = MakeViews({scene.board}, scene.detections, &recording.state.frames);
  Rng rng(seed);
  std::vector<Eigen::Vector2d> bends;
  for (size_t f = 0; f < recording.state.frames.size(); ++f)
    bends.push_back(bend_m * Eigen::Vector2d(rng.Normal(), rng.Normal()));
  for (View& view : recording.views) {
    RigState bent = recording.state;
    bent.board_warp_m[view.board] = bends[static_cast<size_t>(view.frame)];
    const Eigen::Matrix3Xd corners = BentCorners(view, bent);
    view.px += *ResidualsOf(view, bent.cameras[view.camera_idx], CamFromBoard(view, bent), &corners);
    for (Eigen::Index i = 0; i < view.size(); ++i) view.px.col(i) += noise_px * Eigen::Vector2d(rng.Normal(), rng.Normal());
  }
  return recording;
}

TEST(Bending, NoiseAloneIsNoBending) {
  double sum = 0, squares = 0;
  constexpr int kSeeds = 20;
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Recording recording = FilmBent(0.3, 0, seed);
    const BoardBending bending = EstimateBending(recording.views, recording.state, 0.3);
    EXPECT_GE(bending.num_frames, 6);
    sum += bending.sigmas, squares += bending.sigmas * bending.sigmas;
  }
  EXPECT_LT(std::abs(sum / kSeeds), 4 / std::sqrt(double(kSeeds)));
  EXPECT_LT(squares / kSeeds, 3);
}

TEST(Bending, ALimpBoardIsMeasured) {
  const double size = testing::MakeScene({}).board.square_m * testing::MakeScene({}).board.cols;
  const double bend_m = 0.01 * size;
  const Recording recording = FilmBent(0.1, bend_m, 3);
  const BoardBending bending = EstimateBending(recording.views, recording.state, 0.1);
  EXPECT_GT(bending.sigmas, 10);
  EXPECT_NEAR(bending.rms_m / (std::sqrt(2.0) * bend_m), 1, 0.35);
}

TEST(Bending, FewBoardsSayNothing) {
  Recording recording = FilmBent(0.3, 0, 1);
  recording.views.resize(2);
  EXPECT_EQ(EstimateBending(recording.views, recording.state, 0.3).variance_ratio, 1);
}

}  // namespace
}  // namespace mvstudio::calib
