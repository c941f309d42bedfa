#include "calib/rig/board_metrics.h"

#include <cmath>
#include <map>
#include <utility>

#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

SceneOptions Three(double noise_px = 0) {
  SceneOptions options;
  options.num_cameras = 3, options.num_frames = 12, options.noise_px = noise_px;
  return options;
}

BoardMetrics Measure(const testing::Scene& scene, const RigState& state) {
  RigState copy = state;
  const std::vector<View> views = MakeViews({scene.board}, scene.detections, &copy.frames);
  return ComputeBoardMetrics({scene.board}, views, copy);
}

TEST(BoardMetrics, ExactCornersMeasureTheBoard) {
  const testing::Scene scene = MakeScene(Three());
  const BoardMetrics metrics = Measure(scene, scene.truth);
  EXPECT_LT(metrics.edge_rms_mm, 1e-7);
  EXPECT_LT(metrics.pair_rms_mm, 1e-7);
  EXPECT_LT(metrics.reprojection_rms_px, 1e-8);
  EXPECT_EQ(metrics.num_frames, 12);
  EXPECT_GT(metrics.num_points, 500);
  EXPECT_LE(metrics.num_points, 12 * 54);
  EXPECT_LE(metrics.num_edges, 12 * 93);
}

/// A rig that is 1 % too large measures 0.6 mm more on every 60 mm square, and on pairs 1 % of their length.
TEST(BoardMetrics, AScaledRigShowsAsBias) {
  const testing::Scene scene = MakeScene(Three());
  RigState state = scene.truth;
  for (geometry::Rigid3& pose : state.cam_from_world) pose.translation *= 1.01;
  const BoardMetrics metrics = Measure(scene, state);
  EXPECT_NEAR(metrics.edge_bias_mm, 0.6, 1e-6);
  EXPECT_NEAR(metrics.edge_rms_mm, 0.6, 1e-6);
  EXPECT_NEAR(metrics.edge_median_mm, 0.6, 1e-6);
  EXPECT_LT(metrics.reprojection_rms_px, 1e-6);
  testing::Scene whole = scene;  // every corner in all frames: mean and rms over the pairs in closed form
  for (auto& d : whole.detections) {
    if (d.num_corners() < 54) d.corner_ids.clear(), d.points_px.resize(2, 0);
  }
  const BoardMetrics all = Measure(whole, state);
  ASSERT_EQ(all.num_points % 54, 0);
  ASSERT_GT(all.num_points, 0);
  const Eigen::Matrix3Xd corners = CornersInBoard(scene.board);
  double sum = 0, squares = 0;
  int count = 0;
  for (int i = 0; i < 54; ++i) {
    for (int j = i + 1; j < 54; ++j, ++count) {
      const double error = 10 * (corners.col(i) - corners.col(j)).norm();  // 1 % in mm
      sum += error, squares += error * error;
    }
  }
  EXPECT_NEAR(all.pair_bias_mm, sum / count, 1e-5);
  EXPECT_NEAR(all.pair_rms_mm, std::sqrt(squares / count), 1e-5);
}

/// The residual of n views of noise sigma per coordinate has 2 n - 3 degrees of freedom a point.
TEST(BoardMetrics, NoiseComesBackAsResidual) {
  constexpr double kNoise = 0.2;
  const testing::Scene scene = MakeScene(Three(kNoise));
  const BoardMetrics metrics = Measure(scene, scene.truth);
  int observations = 0;
  std::map<std::pair<int64_t, int>, int> count;
  for (const Detection& d : scene.detections) {
    for (int id : d.corner_ids) ++count[{d.frame_idx, id}];
  }
  double expected = 0;
  for (const auto& [corner, n] : count) {
    if (n >= 2) expected += (2 * n - 3) * kNoise * kNoise, observations += n;
  }
  EXPECT_NEAR(metrics.reprojection_rms_px / std::sqrt(expected / observations), 1, 0.05);
  EXPECT_GT(metrics.edge_rms_mm, metrics.edge_median_mm);
  EXPECT_LT(std::abs(metrics.edge_bias_mm), 0.2 * metrics.edge_rms_mm);
}

/// One wild corner, however far: counted, and without a part in the lengths. Its pixels stay in the rms.
TEST(BoardMetrics, OneWildCornerIsCountedOnly) {
  const testing::Scene clean = MakeScene(Three(0.2));
  const BoardMetrics without = Measure(clean, clean.truth);
  EXPECT_EQ(without.num_stray_points, 0);
  for (const double px : {10., 30., 100., 300., 800.}) {
    testing::Scene scene = clean;
    scene.detections[0].points_px(0, 5) += px;
    const BoardMetrics metrics = Measure(scene, scene.truth);
    EXPECT_LE(metrics.num_stray_points, 1);
    EXPECT_NEAR(metrics.pair_rms_mm / without.pair_rms_mm, 1, 0.1) << px;
    EXPECT_NEAR(metrics.edge_median_mm / without.edge_median_mm, 1, 0.1) << px;
    EXPECT_GT(metrics.edge_rms_mm, without.edge_rms_mm) << px;  // of all corners, as peers state it
    EXPECT_GT(metrics.reprojection_rms_px, without.reprojection_rms_px);
  }
}

/// A camera that turned after half of the frames displaces whole boards: all of that stays in the figures.
TEST(BoardMetrics, AMovedCameraStaysInTheLengths) {
  testing::Scene scene = MakeScene(Three(0.2));
  const BoardMetrics before = Measure(scene, scene.truth);
  for (auto& d : scene.detections) {
    if (d.camera_idx == 1 && d.frame_idx % 2) d.points_px.row(0).array() += 30;
  }
  const BoardMetrics metrics = Measure(scene, scene.truth);
  EXPECT_GT(metrics.pair_rms_mm, 3 * before.pair_rms_mm);
}

/// Every tenth corner wrong: too many to be left out without a word.
TEST(BoardMetrics, ManyWildCornersShowAsAShare) {
  testing::Scene scene = MakeScene(Three(0.2));
  Rng rng(5);
  for (auto& d : scene.detections) {
    for (Eigen::Index i = 0; i < d.points_px.cols(); ++i) {
      if (rng.Uniform() < 0.1) d.points_px.col(i) += 60 * Eigen::Vector2d(rng.Uniform(-1, 1), rng.Uniform(-1, 1));
    }
  }
  const BoardMetrics metrics = Measure(scene, scene.truth);
  EXPECT_GT(metrics.num_stray_points, 0.1 * metrics.num_points);
}

TEST(BoardMetrics, OneCameraMeasuresNothing) {
  SceneOptions options;
  options.num_cameras = 1;
  const testing::Scene scene = MakeScene(options);
  const BoardMetrics metrics = Measure(scene, scene.truth);
  EXPECT_TRUE(std::isnan(metrics.edge_rms_mm));
  EXPECT_TRUE(std::isnan(metrics.pair_rms_mm));
  EXPECT_EQ(metrics.num_points, 0);
}

TEST(BoardMetrics, CamerasInOnePlaceMeasureNothing) {
  const testing::Scene scene = MakeScene(Three());
  RigState state = scene.truth;
  std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
  for (View& view : views) view.camera_idx = 0;
  const BoardMetrics metrics = ComputeBoardMetrics({scene.board}, {views[0], views[0]}, state);
  EXPECT_EQ(metrics.num_points, 0);
}

TEST(NeighbouringCorners, OfEveryKindOfBoard) {
  EXPECT_EQ(NeighbouringCorners(ParseBoard("chessboard:9x6:60mm")).size(), 9u * 5 + 8 * 6);
  const Board tags = ParseBoard("aprilgrid:3x2:80mm:0.3");
  const auto sides = NeighbouringCorners(tags);
  EXPECT_EQ(sides.size(), 6u * 4);
  const Eigen::Matrix3Xd corners = CornersInBoard(tags);
  for (const auto& [a, b] : sides) {
    EXPECT_LT(a, b);
    EXPECT_NEAR((corners.col(a) - corners.col(b)).norm(), 0.08, 1e-12);
  }
  Board points;
  points.kind = Board::Kind::kPoints;
  points.points.resize(3, 4);
  points.points << 0, 1, 5, 11, 0, 0, 0, 0, 0, 0, 0, 0;
  const auto nearest = NeighbouringCorners(points);
  ASSERT_EQ(nearest.size(), 1u);
  EXPECT_EQ(nearest[0], std::make_pair(0, 1));
}

}  // namespace
}  // namespace mvstudio::calib
