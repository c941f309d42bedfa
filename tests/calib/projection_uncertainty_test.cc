#include "calib/covariance/projection_uncertainty.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "calib/bundle/rig_problem.h"
#include "calib/bundle/schur_lm.h"
#include "calib/covariance/uncertainty.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Solved {
  testing::Scene scene;
  RigState state;  // the truth, which is the solution without noise
  std::vector<View> views;
};

Solved MakeSolved(SceneOptions options) {
  Solved solved{MakeScene(options), {}, {}};
  solved.state = solved.scene.truth;
  solved.views = MakeViews({solved.scene.board}, solved.scene.detections, &solved.state.frames);
  return solved;
}

SceneOptions Small(int cameras = 2, int frames = 10) {
  SceneOptions options;
  options.num_cameras = cameras, options.num_frames = frames;
  return options;
}

/// Where the boards take a point that is at `x_in_world` while they are as in `before`: the mean over all frames.
Eigen::Vector3d CarriedPoint(const RigState& before, const RigState& after, const Eigen::Vector3d& x_in_world) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (size_t f = 0; f < before.world_from_board.size(); ++f)
    sum += after.world_from_board[f] * (geometry::Inverse(before.world_from_board[f]) * x_in_world);
  return sum / static_cast<double>(before.world_from_board.size());
}

Eigen::Vector3d At(const RigState& state, int camera, const Eigen::Vector2d& px, double range_m) {
  const Eigen::Vector3d ray = geometry::Unproject(state.cameras[camera], px).ray_in_cam;
  return geometry::Inverse(state.cam_from_world[camera]) * (range_m * ray);
}

/// The inverse of all normal equations, boards included, and central differences of the definition instead of Schur complements
/// and derivatives.
TEST(ProjectionUncertainty, IsTheDenseCovarianceOfTheDefinition) {
  const Solved solved = MakeSolved(Small(2, 5));
  BundleOptions options;
  options.refine_warp = true;
  RigProblem problem(solved.views, solved.state, options);
  SchurSystem system;
  problem.AllocateSystem(&system);
  const int n = static_cast<int>(system.g.size()), blocks = system.num_blocks(), all = n + 6 * blocks;
  problem.Try(Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Zero(6, blocks));
  ASSERT_TRUE(problem.LinearizeTrial(&system));
  problem.AcceptTrial();
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(all, all);
  h.topLeftCorner(n, n) = system.h.selfadjointView<Eigen::Lower>();
  for (int b = 0; b < blocks; ++b) {
    h.block<6, 6>(n + 6 * b, n + 6 * b) = system.block_h.middleCols<6>(6 * b);
    for (Eigen::Index i = system.begin[b]; i < system.begin[b + 1]; ++i) {
      h.block<6, 1>(n + 6 * b, system.columns[i]) = system.w.col(i);
      h.block<1, 6>(system.columns[i], n + 6 * b) = system.w.col(i).transpose();
    }
  }
  const Eigen::VectorXd unit = h.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd covariance =
      0.09 * unit.asDiagonal() *
      (unit.asDiagonal() * h * unit.asDiagonal()).eval().ldlt().solve(Eigen::MatrixXd::Identity(all, all)) * unit.asDiagonal();
  const ProjectionUncertainty uncertainty(solved.views, solved.state, options, 0.3);
  for (int camera : {0, 1}) {
    const Eigen::Vector2d px(500, 100);
    const Eigen::Vector3d x_in_world = At(solved.state, camera, px, 1.1);
    Eigen::MatrixXd gradient(2, all);
    for (int i = 0; i < all; ++i) {
      Eigen::Vector2d side[2];
      const double step = 1e-4 * std::sqrt(covariance(i, i));
      for (int k : {0, 1}) {
        Eigen::VectorXd delta = Eigen::VectorXd::Zero(all);
        delta[i] = k ? step : -step;
        const Eigen::MatrixXd boards = Eigen::Map<const Eigen::MatrixXd>(delta.data() + n, 6, blocks);
        RigProblem moved(solved.views, solved.state, options);
        moved.Try(delta.head(n), boards);
        moved.AcceptTrial();
        const RigState& state = moved.state();
        side[k] = geometry::Project(state.cameras[camera],
                                    state.cam_from_world[camera] * CarriedPoint(solved.state, state, x_in_world))
                      .px;
      }
      gradient.col(i) = (side[1] - side[0]) / (2 * step);
    }
    const Eigen::Matrix2d expected = gradient * covariance * gradient.transpose();
    const PixelUncertainty found = uncertainty.PixelCovariance(camera, px, 1.1);
    ASSERT_EQ(found.status, Status::kOk);
    EXPECT_LT((found.covariance_px2 - expected).norm(), 1e-5 * expected.norm()) << found.covariance_px2 << "\n\n" << expected;
  }
}

/// Each noisy solution's projection of points that its boards carried along, over 100 solutions.
TEST(ProjectionUncertainty, PredictsTheScatterOfSolutions) {
  constexpr int kDraws = 100;
  constexpr double kNoise = 0.3;
  const Solved solved = MakeSolved(Small(2, 8));
  BundleOptions options;
  options.reject_outliers = false;
  const ProjectionUncertainty uncertainty(solved.views, solved.state, options, kNoise);
  struct Query {
    int camera;
    Eigen::Vector2d px;
    double range_m;
  };
  const std::vector<Query> queries = {{0, {320, 240}, 1.1}, {0, {60, 60}, 1.1}, {1, {600, 420}, 3}, {1, {320, 240}, 0.7}};
  std::vector<Eigen::Matrix2d> sampled(queries.size(), Eigen::Matrix2d::Zero());
  Rng rng(7);
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<View> views = solved.views;
    for (View& view : views) {
      for (double& coordinate : view.px.reshaped()) coordinate += kNoise * rng.Normal();
    }
    RigState state = solved.state;
    ASSERT_EQ(SolveBundle(&views, &state, options).status, Status::kOk);
    for (size_t q = 0; q < queries.size(); ++q) {
      const Query& query = queries[q];
      const Eigen::Vector3d x = CarriedPoint(solved.state, state, At(solved.state, query.camera, query.px, query.range_m));
      const Eigen::Vector2d d =
          geometry::Project(state.cameras[query.camera], state.cam_from_world[query.camera] * x).px - query.px;
      sampled[q] += d * d.transpose() / kDraws;
    }
  }
  double pooled = 0;
  for (size_t q = 0; q < queries.size(); ++q) {
    const PixelUncertainty found = uncertainty.PixelCovariance(queries[q].camera, queries[q].px, queries[q].range_m);
    ASSERT_EQ(found.status, Status::kOk);
    const double ratio = (found.covariance_px2.inverse() * sampled[q]).trace() / 2;
    // the mean of 200 squares of variance 1: 1 +- 0.1; 3.5 of these
    EXPECT_NEAR(ratio, 1, 0.35) << "query " << q;
    pooled += ratio / static_cast<double>(queries.size());
  }
  EXPECT_NEAR(std::sqrt(pooled), 1, 0.15);
}

/// Camera 0 at rest, camera 1 at rest, board 2 at rest: the same rig, the same knowledge.
TEST(ProjectionUncertainty, DoesNotDependOnTheGauge) {
  const Solved solved = MakeSolved(Small());
  std::vector<Eigen::MatrixXd> maps;
  std::vector<double> points;
  for (const Gauge& gauge : {Gauge{Gauge::Kind::kCamera, 0}, Gauge{Gauge::Kind::kCamera, 1}, Gauge{Gauge::Kind::kBoard, 2}}) {
    BundleOptions options;
    options.gauge = gauge;
    const ProjectionUncertainty uncertainty(solved.views, solved.state, options, 0.2);
    ASSERT_EQ(uncertainty.status(), Status::kOk);
    Eigen::MatrixXd both(6, 8);
    both << uncertainty.UncertaintyMap(0, 4, 6, 1.2), uncertainty.UncertaintyMap(1, 4, 6, kInfinity);
    maps.push_back(both);
    points.push_back(uncertainty.PointCovariance({0.1, 0.1, 0}).worst_m());
  }
  for (int i : {1, 2}) {
    EXPECT_LT((maps[i] - maps[0]).cwiseAbs().maxCoeff(), 1e-6 * maps[0].maxCoeff());
    EXPECT_NEAR(points[i], points[0], 1e-6 * points[0]);
  }
}

TEST(ProjectionUncertainty, MovesWithTheWorldAndScalesWithTheNoise) {
  const Solved solved = MakeSolved(Small());
  const ProjectionUncertainty here(solved.views, solved.state, {}, 0.2);
  RigState moved = solved.state;
  geometry::Rigid3 new_from_old;
  new_from_old.rotation = geometry::RotationExp({0.3, -1, 0.5});
  new_from_old.translation = {1000, -500, 20};
  for (auto& pose : moved.world_from_board) pose = new_from_old * pose;
  for (auto& pose : moved.cam_from_world) pose = pose * geometry::Inverse(new_from_old);
  const ProjectionUncertainty there(solved.views, moved, {}, 0.4);
  const double near = here.PixelCovariance(1, {100, 100}, 1).worst_px(),
               far = there.PixelCovariance(1, {100, 100}, 1).worst_px();
  EXPECT_NEAR(far, 2 * near, 1e-5 * near);
  const double point = here.PointCovariance({0.1, 0, 0.1}).worst_m();
  EXPECT_NEAR(there.PointCovariance(new_from_old * Eigen::Vector3d(0.1, 0, 0.1)).worst_m(), 2 * point, 1e-5 * point);
}

TEST(ProjectionUncertainty, MapAndSingleQueriesAgree) {
  const Solved solved = MakeSolved(Small());
  const ProjectionUncertainty uncertainty(solved.views, solved.state, {}, 0.2);
  const Eigen::MatrixXd map = uncertainty.UncertaintyMap(1, 12, 8, 1.5);
  ASSERT_EQ(map.rows(), 8);
  ASSERT_EQ(map.cols(), 12);
  for (int row : {0, 3, 7}) {
    for (int col : {0, 5, 11})
      EXPECT_NEAR(uncertainty.PixelCovariance(1, {col * 639 / 11.0, row * 479 / 7.0}, 1.5).worst_px(), map(row, col),
                  1e-9 * map(row, col));
  }
  EXPECT_LT(map(4, 6), map(0, 0));  // the middle is known best
  // A far range tends to the direction.
  const double at_infinity = uncertainty.PixelCovariance(1, {100, 400}, kInfinity).worst_px();
  EXPECT_NEAR(uncertainty.PixelCovariance(1, {100, 400}, 1e7).worst_px(), at_infinity, 1e-5 * at_infinity);
}

TEST(ProjectionUncertainty, PointsScatterAsPredicted) {
  constexpr int kDraws = 100;
  constexpr double kNoise = 0.3;
  const Solved solved = MakeSolved(Small(3, 8));
  BundleOptions options;
  options.reject_outliers = false;
  const ProjectionUncertainty uncertainty(solved.views, solved.state, options, kNoise);
  const Eigen::Vector3d target(0.05, 0.1, 0.05);
  const PointUncertainty predicted = uncertainty.PointCovariance(target);
  ASSERT_EQ(predicted.status, Status::kOk);
  Eigen::Matrix3d sampled = Eigen::Matrix3d::Zero();
  Rng rng(11);
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<View> views = solved.views;
    for (View& view : views) {
      for (double& coordinate : view.px.reshaped()) coordinate += kNoise * rng.Normal();
    }
    RigState state = solved.state;
    ASSERT_EQ(SolveBundle(&views, &state, options).status, Status::kOk);
    Eigen::Vector3d x = target;
    for (int step = 0; step < 8; ++step) {  // Gauss-Newton on the noise-free pixels
      Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
      Eigen::Vector3d g = Eigen::Vector3d::Zero();
      for (int c = 0; c < 3; ++c) {
        const Eigen::Vector2d px = geometry::Project(solved.state.cameras[c], solved.state.cam_from_world[c] * target).px;
        const auto at = geometry::Projector(state.cameras[c]).ProjectWithJacobians(state.cam_from_world[c] * x);
        const Eigen::Matrix<double, 2, 3> d = at.d_px_d_x * state.cam_from_world[c].rotation.toRotationMatrix();
        h += d.transpose() * d, g += d.transpose() * (at.px - px);
      }
      x -= h.ldlt().solve(g);
    }
    const Eigen::Vector3d error = x - CarriedPoint(solved.state, state, target);
    sampled += error * error.transpose() / kDraws;
  }
  // the mean of 300 squares of variance 1: 1 +- 0.082; 3.5 of these
  EXPECT_NEAR((predicted.covariance_m2.inverse() * sampled).trace() / 3, 1, 0.29);
}

TEST(ProjectionUncertainty, SaysNoWhereThereIsNoAnswer) {
  SceneOptions folding = Small();
  folding.model = geometry::LensModel::kBrown1;
  const Solved solved = MakeSolved(folding);
  const ProjectionUncertainty uncertainty(solved.views, solved.state, {}, 0.2);
  EXPECT_EQ(uncertainty.PixelCovariance(0, {1e5, 0}, 1).status, Status::kOutsideValidRadius);
  EXPECT_TRUE(std::isnan(uncertainty.PixelCovariance(0, {1e5, 0}, 1).worst_px()));
  EXPECT_EQ(uncertainty.PointCovariance({0, 0, 0}, {0}).status, Status::kTooFewViews);
  EXPECT_EQ(uncertainty.PointCovariance({0, 0, 0}, {0, 0}).status, Status::kLowParallax);
  EXPECT_NE(uncertainty.PointCovariance({0, -100, 0}, {0, 1}).status, Status::kOk);

  SceneOptions flat = Small(1, 6);
  flat.max_tilt_rad = 0, flat.model = geometry::LensModel::kPinhole;
  const Solved parallel = MakeSolved(flat);
  const ProjectionUncertainty undetermined(parallel.views, parallel.state, {}, 0.2);
  EXPECT_EQ(undetermined.status(), Status::kDegenerate);
  EXPECT_EQ(undetermined.PixelCovariance(0, {320, 240}, 1).status, Status::kDegenerate);
  EXPECT_TRUE(std::isnan(undetermined.Summarize().centre_px));
}

/// Lenses alone, every view in a frame of its own camera: a camera is judged by its own boards.
TEST(ProjectionUncertainty, UnlinkedCamerasHaveTheirOwnBoards) {
  const Solved solved = MakeSolved(Small());
  RigState apart = solved.state;
  std::vector<View> views = solved.views;
  apart.frames.clear(), apart.world_from_board.clear();
  for (size_t v = 0; v < views.size(); ++v) {
    apart.frames.push_back(static_cast<int64_t>(v));
    apart.world_from_board.push_back(CamFromBoard(solved.views[v], solved.state));
    views[v].frame = static_cast<int>(v);
  }
  apart.cam_from_world.assign(2, geometry::Rigid3());
  BundleOptions options;
  options.gauge.kind = Gauge::Kind::kNone, options.refine_cameras = false;
  const ProjectionUncertainty both(views, apart, options, 0.2);
  std::vector<View> of_one;
  for (const View& view : views) {
    if (view.camera_idx == 1) of_one.push_back(view);
  }
  const ProjectionUncertainty one(of_one, apart, options, 0.2);
  const double alone = one.PixelCovariance(1, {50, 50}, 1).worst_px();
  EXPECT_NEAR(both.PixelCovariance(1, {50, 50}, 1).worst_px(), alone, 1e-9 * alone);
  EXPECT_EQ(one.PixelCovariance(0, {50, 50}, 1).status, Status::kTooFewViews);
  EXPECT_EQ(both.PointCovariance({0, 0, 1}, {0, 1}).status, Status::kDegenerate);
  EXPECT_TRUE(std::isnan(one.Summarize().volume_mm));
}

TEST(ProjectionUncertainty, SharedAndSplinedLenses) {
  SceneOptions options = Small(2, 12);
  Solved solved = MakeSolved(options);
  solved.state.cameras[1].params = solved.state.cameras[0].params;  // any point will do: only derivatives count
  const ProjectionUncertainty own(solved.views, solved.state, {}, 0.2);
  solved.state.lens_group = {0, 0};
  const ProjectionUncertainty shared(solved.views, solved.state, {}, 0.2);
  EXPECT_LT(shared.Summarize().corner_px, own.Summarize().corner_px);

  geometry::Camera splined{"s", geometry::LensModel::kSplined, 640, 480, Eigen::VectorXd::Zero(4 + 2 * 8 * 6), {3, 8, 6, 80}};
  splined.params.head<4>() << 560, 560, 320, 240;
  for (geometry::Camera& camera : solved.state.cameras) camera = splined;
  solved.state.lens_group.clear();
  const ProjectionUncertainty spline(solved.views, solved.state, {}, 0.2);
  ASSERT_EQ(spline.status(), Status::kOk);
  const Eigen::MatrixXd map = spline.UncertaintyMap(0, 12, 8, 1.2);
  for (int row : {2, 5}) {
    const double single = spline.PixelCovariance(0, {6 * 639 / 11.0, row * 479 / 7.0}, 1.2).worst_px();
    EXPECT_NEAR(map(row, 6), single, 1e-6 * single);
  }
}

TEST(ProjectionUncertainty, SummaryTakesTheWorst) {
  const Solved solved = MakeSolved(Small(3, 12));
  const ProjectionUncertainty uncertainty(solved.views, solved.state, {}, 0.2);
  const UncertaintySummary summary = uncertainty.Summarize();
  ASSERT_EQ(summary.cameras.size(), 3u);
  double centre = 0;
  for (const CameraUncertainty& camera : summary.cameras) {
    EXPECT_LT(camera.centre_px, camera.edge_px);
    EXPECT_LT(camera.edge_px, camera.corner_px);
    EXPECT_GT(camera.range_m, 0.9);
    EXPECT_LT(camera.range_m, 1.6);
    centre = std::max(centre, camera.centre_px);
  }
  EXPECT_EQ(summary.centre_px, centre);
  EXPECT_NEAR(uncertainty.PixelCovariance(0, {319.5, 239.5}, summary.cameras[0].range_m).worst_px(),
              summary.cameras[0].centre_px, 1e-12);
  const std::vector<double> volume = uncertainty.VolumeUncertainty(1000);
  ASSERT_GT(volume.size(), 60u);
  EXPECT_TRUE(std::is_sorted(volume.begin(), volume.end()));
  EXPECT_GT(summary.volume_mm, 0.01);
  EXPECT_LT(summary.volume_mm, 1);
  EXPECT_LE(summary.volume_mm, summary.volume_max_mm);
}

}  // namespace
}  // namespace mvstudio::calib
