#include "calib/bundle/rig_problem.h"

#include <Eigen/Cholesky>

#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// Three cameras, two of which share a lens, two boards that are rigid to each other, bent and stretched boards, a late
/// camera.
struct Case {
  RigState state;
  std::vector<View> views;
  BundleOptions options;
};

Case MakeCase() {
  testing::SceneOptions scene_options;
  scene_options.num_cameras = 3;
  scene_options.num_frames = 6;
  const testing::Scene scene = testing::MakeScene(scene_options);
  Case c;
  c.state = scene.truth;
  c.state.rig_from_board.resize(2);
  c.state.rig_from_board[1].rotation = geometry::RotationExp({0.1, -0.2, 0.3});
  c.state.rig_from_board[1].translation = {0.1, 0.05, -0.02};
  c.state.board_warp_m = {Eigen::Vector2d(1e-3, -5e-4), Eigen::Vector2d(-2e-3, 1e-3)};
  c.state.board_stretch = {Eigen::Vector2d(-2e-3, 1e-3), Eigen::Vector2d(1e-3, 3e-3)};
  c.state.time_offset_frames = {0, 0.3, -0.2};
  c.state.board_velocity.assign(c.state.frames.size(), geometry::Vector6d::Constant(0.02));
  c.state.board_acceleration.assign(c.state.frames.size(), geometry::Vector6d::Constant(-0.03));
  c.state.cameras[2].params = c.state.cameras[1].params;
  c.state.lens_group = {0, 1, 1};
  c.views = MakeViews({scene.board}, scene.detections, &c.state.frames);
  for (size_t v = 0; v < c.views.size(); ++v) c.views[v].board = v % 2;
  c.options.refine_warp = c.options.refine_stretch = c.options.refine_time = true;
  c.options.gauge.index = 0;
  return c;
}

/// Makes the state explain its views exactly.
void ObserveCase(Case* c) {
  for (View& view : c->views) {
    View any = view;
    any.px.setZero();
    const Eigen::Matrix3Xd corners = BentCorners(view, c->state);
    view.px = *ResidualsOf(any, c->state.cameras[view.camera_idx], CamFromBoard(view, c->state), &corners);
  }
}

struct Moved {
  Eigen::VectorXd global;
  Eigen::MatrixXd blocks;
};

Moved RandomStep(const SchurSystem& system, double size, Rng* rng) {
  Moved step{Eigen::VectorXd(system.g.size()), Eigen::MatrixXd(6, system.num_blocks())};
  // Steps of all unknowns move the image by about as much.
  for (Eigen::Index i = 0; i < step.global.size(); ++i) step.global[i] = size * rng->Normal() / std::sqrt(system.h(i, i));
  for (Eigen::Index i = 0; i < step.blocks.size(); ++i) {
    const Eigen::Index row = i % 6, column = i / 6;
    step.blocks(row, column) = size * rng->Normal() / std::sqrt(system.block_h(row, 6 * column + row));
  }
  return step;
}

double Quadratic(const SchurSystem& system, const Moved& step) {
  const Eigen::MatrixXd h = system.h.selfadjointView<Eigen::Lower>();
  double value = step.global.dot(h * step.global);
  for (int b = 0; b < system.num_blocks(); ++b) {
    const Eigen::VectorXd block = step.blocks.col(b);
    value += block.dot(system.block_h.middleCols(6 * b, 6) * block);
    for (Eigen::Index k = system.begin[b]; k < system.begin[b + 1]; ++k)
      value += 2 * block.dot(system.w.col(k)) * step.global[system.columns[k]];
  }
  return value;
}

TEST(RigProblem, NormalEquationsPredictTheCostAroundAnExactSolution) {
  Case c = MakeCase();
  ObserveCase(&c);
  RigProblem problem(c.views, c.state, c.options);
  EXPECT_EQ(problem.columns().total, 8 + 8 + 2 * 6 + 2 + 6 + 4 + 4);
  SchurSystem system, trial;
  problem.AllocateSystem(&system);
  problem.Try(Eigen::VectorXd::Zero(system.g.size()), Eigen::MatrixXd::Zero(6, system.num_blocks()));
  ASSERT_TRUE(problem.LinearizeTrial(&system));
  EXPECT_LT(system.cost, 1e-18);
  trial = system;
  Rng rng(3);
  for (int sample = 0; sample < 10; ++sample) {
    const Moved step = RandomStep(system, 1e-3, &rng);
    problem.Try(step.global, step.blocks);
    ASSERT_TRUE(problem.LinearizeTrial(&trial));
    const double predicted = Quadratic(system, step);
    EXPECT_NEAR(trial.cost / predicted, 1, 1e-4);
  }
}

TEST(RigProblem, GradientAgreesWithFiniteDifferences) {
  Case c = MakeCase();
  ObserveCase(&c);
  Rng noise(8);
  for (View& view : c.views) {
    for (Eigen::Index i = 0; i < view.px.size(); ++i) view.px(i % 2, i / 2) += noise.Normal();
    for (Eigen::Index i = 0; i < view.size(); ++i) view.weights[i] = noise.Uniform();
  }
  RigProblem problem(c.views, c.state, c.options);
  SchurSystem system, trial;
  problem.AllocateSystem(&system);
  problem.Try(Eigen::VectorXd::Zero(system.g.size()), Eigen::MatrixXd::Zero(6, system.num_blocks()));
  ASSERT_TRUE(problem.LinearizeTrial(&system));
  trial = system;
  Rng rng(4);
  for (int sample = 0; sample < 10; ++sample) {
    const Moved step = RandomStep(system, 1e-4, &rng);
    double sides[2];
    for (int side = 0; side < 2; ++side) {
      problem.Try((2 * side - 1) * step.global, (2 * side - 1) * step.blocks);
      ASSERT_TRUE(problem.LinearizeTrial(&trial));
      sides[side] = trial.cost;
    }
    double predicted = system.g.dot(step.global);
    for (int b = 0; b < system.num_blocks(); ++b) predicted += system.block_g.col(b).dot(step.blocks.col(b));
    EXPECT_NEAR((sides[1] - sides[0]) / 4, predicted, 1e-5 * std::sqrt(system.cost) * 1e-3 + 1e-6 * std::abs(predicted));
  }
}

TEST(RigProblem, ThreadsDoNotChangeTheResult) {
  Case c = MakeCase();
  ObserveCase(&c);
  for (View& view : c.views) view.px.row(0).array() += 0.5;
  SchurSystem systems[2];
  for (int threads = 1; threads <= 2; ++threads) {
    c.options.num_threads = threads;
    RigProblem problem(c.views, c.state, c.options);
    problem.AllocateSystem(&systems[threads - 1]);
    SchurLmOptions lm;
    lm.num_threads = threads;
    SolveSchurLm(&problem, &systems[threads - 1], lm);
  }
  EXPECT_EQ(systems[0].cost, systems[1].cost);
  EXPECT_EQ(systems[0].h, systems[1].h);
}

TEST(SolveBundle, RecoversEverythingThatIsFree) {
  Case c = MakeCase();
  c.state.time_offset_frames.clear();
  c.options.refine_time = false;
  ObserveCase(&c);
  RigState start = c.state;
  Rng rng(5);
  start.board_warp_m = {Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};
  start.board_stretch.clear();
  for (int camera : {1, 2}) start.cameras[camera].params.head<4>() += Eigen::Vector4d(8, -5, 3, 4);
  geometry::Vector6d kick;
  kick << 0.02, -0.01, 0.02, 0.01, 0.02, -0.01;
  start.rig_from_board[1] = geometry::Perturb(kick, start.rig_from_board[1]);
  start.cam_from_world[1] = geometry::Perturb(kick, start.cam_from_world[1]);
  BundleOptions options = c.options;
  options.reject_outliers = false;
  const BundleReport report = SolveBundle(&c.views, &start, options);
  EXPECT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_LT(report.rms_px, 1e-8);
  EXPECT_LT((start.board_warp_m[1] - c.state.board_warp_m[1]).norm(), 1e-8);
  for (int b = 0; b < 2; ++b) EXPECT_LT((start.board_stretch[b] - c.state.board_stretch[b]).norm(), 1e-8);
  EXPECT_LT((start.rig_from_board[1].translation - c.state.rig_from_board[1].translation).norm(), 1e-8);
  EXPECT_EQ(start.cameras[1].params, start.cameras[2].params);
  EXPECT_LT((start.cameras[1].params - c.state.cameras[1].params).norm(), 1e-5);
}

}  // namespace
}  // namespace mvstudio::calib
