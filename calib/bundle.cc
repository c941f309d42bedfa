#include "calib/bundle.h"

#include <ceres/ceres.h>
#include <glog/logging.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "calib/homography.h"
#include "core/check.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using PoseBlock = std::array<double, 7>;  // quaternion x, y, z, w, then translation

constexpr int kRobustRounds = 3, kRejectRounds = 6;
constexpr double kDistanceToSigma = 0.8493218;  // median 2-D distance to standard deviation per coordinate
constexpr double kMinSigmaPx = 1e-7;            // below it, residuals are rounding errors and nothing is an outlier

PoseBlock ToBlock(const Rigid3& pose) {
  PoseBlock block;
  Eigen::Map<Eigen::Vector4d>(block.data()) = pose.rotation.coeffs();
  Eigen::Map<Eigen::Vector3d>(block.data() + 4) = pose.translation;
  return block;
}

Rigid3 FromBlock(const double* block) {
  Rigid3 pose;
  pose.rotation.coeffs() = Eigen::Map<const Eigen::Vector4d>(block);
  pose.translation = Eigen::Map<const Eigen::Vector3d>(block + 4);
  return pose;
}

/// d q / d w of q' = Exp(w) q at w = 0, (4, 3); its columns are orthogonal and of length 1/2.
Eigen::Matrix<double, 4, 3> QuaternionJacobian(const double* q) {
  Eigen::Matrix<double, 4, 3> j;
  j << q[3], q[2], -q[1], -q[2], q[3], q[0], q[1], -q[0], q[3], -q[0], -q[1], -q[2];
  return 0.5 * j;
}

/// Left perturbation (rotation, translation) of a pose block.
class PoseManifold : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* out) const override {
    const PoseBlock block = ToBlock(geometry::Perturb(Eigen::Map<const geometry::Vector6d>(delta), FromBlock(x)));
    std::copy(block.begin(), block.end(), out);
    return true;
  }
  bool PlusJacobian(const double* x, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>> j(jacobian);
    j.setZero();
    j.topLeftCorner<4, 3>() = QuaternionJacobian(x);
    j.bottomRightCorner<3, 3>().setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* delta) const override {
    const Rigid3 a = FromBlock(y), b = FromBlock(x);
    Eigen::Map<geometry::Vector6d> difference(delta);
    difference << geometry::RotationLog(a.rotation * b.rotation.conjugate()), a.translation - b.translation;
    return true;
  }
  bool MinusJacobian(const double* x, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> j(jacobian);
    j.setZero();
    j.topLeftCorner<3, 4>() = 4 * QuaternionJacobian(x).transpose();
    j.bottomRightCorner<3, 3>().setIdentity();
    return true;
  }
};

/// All corners of one view. Blocks: parameters of the camera, cam_from_world, world_from_board.
class ViewCost : public ceres::CostFunction {
 public:
  ViewCost(const View& view, const geometry::Camera& camera) : view_(view), camera_(camera) {
    set_num_residuals(static_cast<int>(2 * view.size()));
    *mutable_parameter_block_sizes() = {static_cast<int32_t>(camera.params.size()), 7, 7};
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    geometry::Camera camera = camera_;
    camera.params = Eigen::Map<const Eigen::VectorXd>(parameters[0], camera.params.size());
    const auto linear = LinearizeView(view_, camera, FromBlock(parameters[1]), FromBlock(parameters[2]));
    if (!linear) return false;
    Eigen::Map<Eigen::VectorXd>(residuals, linear->residuals.size()) = linear->residuals;
    if (!jacobians) return true;
    if (jacobians[0]) Eigen::Map<RowMatrix>(jacobians[0], linear->d_params.rows(), linear->d_params.cols()) = linear->d_params;
    if (jacobians[1]) ToAmbient(linear->d_cam, parameters[1], jacobians[1]);
    if (jacobians[2]) ToAmbient(linear->d_board, parameters[2], jacobians[2]);
    return true;
  }

 private:
  /// Derivatives with respect to the seven numbers of the block, such that Ceres' product with PlusJacobian restores `tangent`.
  static void ToAmbient(const Eigen::MatrixXd& tangent, const double* block, double* jacobian) {
    Eigen::Map<RowMatrix> out(jacobian, tangent.rows(), 7);
    out.leftCols(4) = tangent.leftCols(3) * (4 * QuaternionJacobian(block).transpose());
    out.rightCols(3) = tangent.rightCols(3);
  }

  const View& view_;
  const geometry::Camera& camera_;
};

/// The state as Ceres' parameter blocks.
struct Blocks {
  std::vector<Eigen::VectorXd> params;
  std::vector<PoseBlock> cameras, boards;
};

Blocks ToBlocks(const RigState& state) {
  Blocks blocks;
  for (const auto& camera : state.cameras) blocks.params.push_back(camera.params);
  for (const Rigid3& pose : state.cam_from_world) blocks.cameras.push_back(ToBlock(pose));
  for (const Rigid3& pose : state.world_from_board) blocks.boards.push_back(ToBlock(pose));
  return blocks;
}

void FromBlocks(const Blocks& blocks, RigState* state) {
  for (size_t i = 0; i < blocks.params.size(); ++i) {
    state->cameras[i].params = blocks.params[i];
    state->cam_from_world[i] = FromBlock(blocks.cameras[i].data());
  }
  for (size_t i = 0; i < blocks.boards.size(); ++i) state->world_from_board[i] = FromBlock(blocks.boards[i].data());
}

void FixBlocks(const BundleOptions& options, Blocks* blocks, ceres::Problem* problem) {
  const auto fix = [&](double* block) {
    if (problem->HasParameterBlock(block)) problem->SetParameterBlockConstant(block);
  };
  for (size_t i = 0; i < blocks->cameras.size(); ++i) {
    if (!options.refine_intrinsics) fix(blocks->params[i].data());
    if (!options.refine_cameras) fix(blocks->cameras[i].data());
  }
  if (options.gauge.kind == Gauge::Kind::kCamera) {
    fix(blocks->cameras.at(options.gauge.index).data());
  } else {
    fix(blocks->boards.at(options.gauge.index).data());
  }
}

ceres::Solver::Options SolverOptions(const BundleOptions& options) {
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.max_num_iterations = options.max_iterations;
  solver.function_tolerance = 1e-11;
  solver.parameter_tolerance = 1e-12;
  solver.gradient_tolerance = 1e-14;
  solver.num_threads = options.num_threads;
  solver.logging_type = ceres::SILENT;
  solver.use_nonmonotonic_steps = false;
  return solver;
}

/// Ceres reports rejected steps through glog, on stderr; here they are no news.
void SilenceGlog() {
  static const bool once = [] {
    FLAGS_minloglevel = std::max(FLAGS_minloglevel, 3);
    return true;
  }();
  static_cast<void>(once);
}

/// One least-squares solution with the weights as they are.
Status SolveOnce(const std::vector<View>& views, const BundleOptions& options, RigState* state, int* iterations) {
  SilenceGlog();
  Blocks blocks = ToBlocks(*state);
  ceres::Problem::Options problem_options;
  problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  PoseManifold manifold;
  ceres::Problem problem(problem_options);
  auto* ordering = new ceres::ParameterBlockOrdering;
  ceres::Solver::Options solver = SolverOptions(options);
  solver.linear_solver_ordering.reset(ordering);
  for (const View& view : views) {
    if ((view.weights.array() > 0).count() == 0) continue;
    double* params = blocks.params[view.camera_idx].data();
    double* camera = blocks.cameras[view.camera_idx].data();
    double* board = blocks.boards[view.frame].data();
    problem.AddResidualBlock(new ViewCost(view, state->cameras[view.camera_idx]), nullptr, params, camera, board);
    problem.SetManifold(camera, &manifold);
    problem.SetManifold(board, &manifold);
    ordering->AddElementToGroup(board, 0);
    ordering->AddElementToGroup(params, 1);
    ordering->AddElementToGroup(camera, 1);
  }
  FixBlocks(options, &blocks, &problem);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  *iterations += static_cast<int>(summary.iterations.size());
  if (summary.termination_type == ceres::FAILURE) return Status::kBehindCamera;
  FromBlocks(blocks, state);
  return summary.termination_type == ceres::CONVERGENCE ? Status::kOk : Status::kNotConverged;
}

std::vector<Eigen::VectorXd> Distances(const std::vector<View>& views, const RigState& state) {
  std::vector<Eigen::VectorXd> distances;
  for (const Eigen::Matrix2Xd& residuals : BundleResiduals(views, state)) distances.push_back(residuals.colwise().norm());
  return distances;
}

double RobustSigma(const std::vector<Eigen::VectorXd>& distances, const std::vector<View>& views) {
  std::vector<double> kept;
  for (size_t v = 0; v < views.size(); ++v) {
    for (Eigen::Index i = 0; i < views[v].size(); ++i) {
      if (views[v].weights[i] > 0) kept.push_back(distances[v][i]);
    }
  }
  return kDistanceToSigma * Median(Eigen::Map<const Eigen::VectorXd>(kept.data(), kept.size()));
}

/// Weights that fall with the squared distance (Cauchy), times the prior weights.
void SetRobustWeights(const RigState& state, const std::vector<Eigen::VectorXd>& prior, std::vector<View>* views) {
  const auto distances = Distances(*views, state);
  const double scale = 3 * std::max(kMinSigmaPx, RobustSigma(distances, *views));
  for (size_t v = 0; v < views->size(); ++v) {
    (*views)[v].weights = prior[v].array() / (1 + (distances[v] / scale).array().square());
  }
}

/// Weights 0 for corners beyond the limit, the prior weights otherwise. Returns how many changed sides.
int SetRejections(const RigState& state, const std::vector<Eigen::VectorXd>& prior, double sigmas, std::vector<View>* views) {
  const auto distances = Distances(*views, state);
  const double limit = sigmas * std::max(kMinSigmaPx, RobustSigma(distances, *views));
  int changes = 0;
  for (size_t v = 0; v < views->size(); ++v) {
    Eigen::VectorXd& weights = (*views)[v].weights;
    for (Eigen::Index i = 0; i < weights.size(); ++i) {
      const double weight = distances[v][i] <= limit ? prior[v][i] : 0;
      changes += (weight > 0) != (weights[i] > 0);
      weights[i] = weight;
    }
    if ((weights.array() > 0).count() < 4) weights.setZero();
  }
  return changes;
}

void Summarize(const std::vector<View>& views, const RigState& state, const BundleOptions& options,
               const std::vector<Eigen::VectorXd>& prior, BundleReport* report) {
  const auto distances = Distances(views, state);
  double sum = 0;
  std::vector<bool> seen(state.frames.size(), false);
  for (size_t v = 0; v < views.size(); ++v) {
    for (Eigen::Index i = 0; i < views[v].size(); ++i) {
      report->num_rejected += prior[v][i] > 0 && views[v].weights[i] <= 0;
      if (views[v].weights[i] <= 0) continue;
      sum += distances[v][i] * distances[v][i];
      report->num_corners += 1;
      seen[views[v].frame] = true;
    }
  }
  int unknowns = 6 * static_cast<int>(std::count(seen.begin(), seen.end(), true)) - 6;
  for (const auto& camera : state.cameras) {
    unknowns += (options.refine_intrinsics ? static_cast<int>(camera.params.size()) : 0) + (options.refine_cameras ? 6 : 0);
  }
  report->rms_px = std::sqrt(sum / std::max(1, report->num_corners));
  report->sigma_px = std::sqrt(sum / std::max(1, 2 * report->num_corners - unknowns));
}

BundleReport Failed(Status status, const std::string& message) {
  BundleReport report;
  report.status = status;
  report.message = message;
  return report;
}

std::optional<BundleReport> CheckInput(const std::vector<View>& views, const RigState& state) {
  Eigen::Index corners = 0;
  for (const View& view : views) {
    MVS_CHECK(view.camera_idx >= 0 && view.camera_idx < static_cast<int>(state.cameras.size()), "camera " << view.camera_idx);
    MVS_CHECK(view.frame >= 0 && view.frame < static_cast<int>(state.world_from_board.size()), "frame " << view.frame);
    if (!view.px.allFinite()) return Failed(Status::kNonFiniteInput, "a corner position is not a finite number");
    corners += (view.weights.array() > 0).count();
  }
  if (corners < 4) return Failed(Status::kTooFewViews, "fewer than 4 corners to adjust");
  return std::nullopt;
}

}  // namespace

std::vector<Eigen::Matrix2Xd> BundleResiduals(const std::vector<View>& views, const RigState& state) {
  std::vector<Eigen::Matrix2Xd> all;
  for (const View& view : views) {
    View any = view;
    any.weights.setZero();  // so that corners that do not project give infinity
    const Rigid3 cam_from_board = state.cam_from_world[view.camera_idx] * state.world_from_board[view.frame];
    all.push_back(*ResidualsOf(any, state.cameras[view.camera_idx], cam_from_board));
  }
  return all;
}

BundleReport SolveBundle(std::vector<View>* views, RigState* state, const BundleOptions& options) {
  if (const auto failed = CheckInput(*views, *state)) return *failed;
  std::vector<Eigen::VectorXd> prior;
  for (const View& view : *views) prior.push_back(view.weights);
  BundleReport report;
  const char* const kUnusable = "the start of the adjustment puts corners behind a camera";
  for (int round = 0; options.reject_outliers && round < kRobustRounds; ++round) {
    SetRobustWeights(*state, prior, views);
    BundleOptions loose = options;
    loose.max_iterations = std::min(options.max_iterations, 30);
    if (SolveOnce(*views, loose, state, &report.num_iterations) == Status::kBehindCamera)
      return Failed(Status::kBehindCamera, kUnusable);
  }
  for (size_t v = 0; v < views->size(); ++v) (*views)[v].weights = prior[v];
  for (int round = 0; round < kRejectRounds; ++round) {
    const int changes = options.reject_outliers ? SetRejections(*state, prior, options.reject_sigmas, views) : 0;
    if (round > 0 && changes == 0) break;
    report.status = SolveOnce(*views, options, state, &report.num_iterations);
    if (report.status == Status::kBehindCamera) return Failed(Status::kBehindCamera, kUnusable);
  }
  if (report.status != Status::kOk) report.message = "the adjustment did not reach its tolerance";
  Summarize(*views, *state, options, prior, &report);
  return report;
}

}  // namespace mvstudio::calib
