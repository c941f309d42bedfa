#include "calib/bundle/bundle.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "calib/bundle/camera_noise.h"
#include "calib/bundle/rig_problem.h"
#include "core/check.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

constexpr double kRobustScales[] = {
    30, 10, 3};  // standard deviations; wide first: a lens must reach the edges before they count as wrong
constexpr int kRejectRounds = 6;
constexpr double kRobustTolerance = 1e-3, kRejectTolerance = 1e-5;  // relative decrease of the cost that ends these rounds

/// Residuals below this are the rounding errors of pixel coordinates.
double RoundingPx(const RigState& state) {
  int size = 0;
  for (const geometry::Camera& camera : state.cameras) size = std::max({size, camera.width_px, camera.height_px});
  return 16 * std::numeric_limits<double>::epsilon() * std::max(1000, size);
}

/// Moves the world so that its origin lies at `origin_in_world`.
void MoveOrigin(const Eigen::Vector3d& origin_in_world, RigState* state) {
  for (Rigid3& world_from_board : state->world_from_board) world_from_board.translation -= origin_in_world;
  for (Rigid3& cam_from_world : state->cam_from_world) cam_from_world.translation += cam_from_world.rotation * origin_in_world;
}

/// Where the boards are, when that is so far from the origin that coordinates would lose digits; zero otherwise.
Eigen::Vector3d FarCentre(const RigState& state) {
  constexpr double kFar = 1e3;  // spreads
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  if (state.world_from_board.empty()) return centre;
  for (const Rigid3& pose : state.world_from_board)
    centre += pose.translation / static_cast<double>(state.world_from_board.size());
  double spread = 0;
  for (const Rigid3& pose : state.world_from_board) spread = std::max(spread, (pose.translation - centre).norm());
  return centre.norm() > kFar * spread ? centre : Eigen::Vector3d(Eigen::Vector3d::Zero());
}

/// One least-squares solution with the weights as they are.
Status SolveOnce(const std::vector<View>& views, const BundleOptions& options, double tolerance, RigState* state,
                 int* iterations) {
  if (options.refine_time) {
    if (state->time_offset_frames.empty()) state->time_offset_frames.assign(state->cameras.size(), 0);
    if (options.refine_rate && state->time_rate.empty()) state->time_rate.assign(state->cameras.size(), 0);
    EstimateMotion(views, state);
  }
  if (options.refine_stretch && state->board_stretch.empty())
    state->board_stretch.assign(state->rig_from_board.size(), Eigen::Vector2d::Zero());
  RigProblem problem(views, *state, options);
  SchurSystem system;
  problem.AllocateSystem(&system);
  Eigen::Index corners = 0;
  for (const View& view : views) corners += view.size();
  SchurLmOptions lm;
  lm.max_iterations = options.max_iterations;
  lm.cost_tolerance = tolerance;
  lm.first_damping = options.first_damping;
  const double rounding_px = RoundingPx(*state);
  lm.negligible_cost = 2 * static_cast<double>(corners) * rounding_px * rounding_px;
  lm.num_threads = options.num_threads;
  const SchurLmReport report = SolveSchurLm(&problem, &system, lm);
  *iterations += report.num_iterations;
  if (report.status == Status::kOk || report.status == Status::kNotConverged) *state = problem.state();
  return report.status;
}

/// Weights that fall with the squared distance (Cauchy), times the prior weights.
void SetRobustWeights(const RigState& state, const Priors& prior, double sigmas, bool each_camera, std::vector<View>* views) {
  const auto distances = Standardized(*views, state, prior);
  const CameraNoise noise = RobustNoise(distances, *views, state, each_camera);
  for (size_t v = 0; v < views->size(); ++v) {
    const int c = (*views)[v].camera_idx;
    (*views)[v].weights =
        noise.weight[c] * prior[v].array() / (1 + (distances[v] / (sigmas * noise.limit_px[c])).array().square());
  }
}

/// Weights 0 for corners beyond the limit, those of their camera otherwise. Returns how many changed sides.
int SetRejections(const RigState& state, const Priors& prior, double sigmas, bool each_camera, std::vector<View>* views) {
  const auto distances = Standardized(*views, state, prior);
  const CameraNoise noise = KeptNoise(distances, *views, state, each_camera);
  int changes = 0;
  for (size_t v = 0; v < views->size(); ++v) {
    Eigen::VectorXd& weights = (*views)[v].weights;
    const int c = (*views)[v].camera_idx;
    for (Eigen::Index i = 0; i < weights.size(); ++i) {
      const double weight = distances[v][i] <= sigmas * noise.limit_px[c] ? noise.weight[c] * prior[v][i] : 0;
      changes += (weight > 0) != (weights[i] > 0);
      weights[i] = weight;
    }
    if ((weights.array() > 0).count() < 4) weights.setZero();
  }
  return changes;
}

void Summarize(const std::vector<View>& views, const RigState& state, const BundleOptions& options, const Priors& prior,
               BundleReport* report) {
  const auto distances = CornerDistances(views, state);
  double sum = 0, weighted = 0;
  std::vector<bool> seen(state.frames.size(), false);
  for (size_t v = 0; v < views.size(); ++v) {
    for (Eigen::Index i = 0; i < views[v].size(); ++i) {
      report->num_rejected += prior[v][i] > 0 && views[v].weights[i] <= 0;
      if (views[v].weights[i] <= 0) continue;
      sum += distances[v][i] * distances[v][i];
      weighted += views[v].weights[i] * distances[v][i] * distances[v][i];
      report->num_corners += 1;
      seen[views[v].frame] = true;
    }
  }
  const int unknowns = 6 * static_cast<int>(std::count(seen.begin(), seen.end(), true)) -
                       (options.gauge.kind == Gauge::Kind::kBoard ? 6 : 0) + MakeColumns(views, state, options).total;
  report->rms_px = std::sqrt(sum / std::max(1, report->num_corners));
  report->sigma_px = std::sqrt(weighted / std::max(1, 2 * report->num_corners - unknowns));
  report->camera_sigma_px = CameraSigmas(views, prior, report->sigma_px, static_cast<int>(state.cameras.size()));
}

}  // namespace

namespace {

/// The observed frames that say how the boards move in frame `f`: the nearest before and after it, or else those on one side.
std::vector<size_t> MotionNodes(const std::vector<int64_t>& frames, const std::vector<bool>& seen, const MotionModel& model,
                                size_t f) {
  const auto nearest = [&](int direction, int count) {
    std::vector<size_t> nodes;
    int64_t next = model.gap;
    for (size_t g = f + direction; g < frames.size() && static_cast<int>(nodes.size()) < count; g += direction) {
      const int64_t away = (frames[g] - frames[f]) * direction;
      if (away <= 0 || away > model.reach) break;
      if (seen[g] && away >= next) nodes.push_back(g), next = away + model.gap;
    }
    return nodes;
  };
  std::vector<size_t> nodes = nearest(-1, model.neighbours), after = nearest(1, model.neighbours);
  if (nodes.empty() != after.empty() && !seen[f]) {  // two on one side
    const int count = model.neighbours + 1;
    std::vector<size_t>& side = nodes.empty() ? after : nodes;
    side = nearest(nodes.empty() ? 1 : -1, count);
    if (side.size() < 2) return {};
  }
  nodes.insert(nodes.end(), after.begin(), after.end());
  return nodes;
}

/// What turns (left) and shifts one pose into another.
geometry::Vector6d MotionBetween(const Rigid3& from, const Rigid3& to) {
  geometry::Vector6d motion;
  motion << geometry::RotationLog(to.rotation * from.rotation.conjugate()), to.translation - from.translation;
  return motion;
}

/// The pose at frame `f` on the polynomial through those of `nodes` (Lagrange).
Rigid3 PoseBetween(const RigState& state, const std::vector<size_t>& nodes, size_t f) {
  const Rigid3& base = state.world_from_board[nodes[0]];
  geometry::Vector6d motion = geometry::Vector6d::Zero();
  for (const size_t k : nodes) {
    double share = 1;
    for (const size_t j : nodes) {
      if (j != k)
        share *=
            static_cast<double>(state.frames[f] - state.frames[j]) / static_cast<double>(state.frames[k] - state.frames[j]);
    }
    motion += share * MotionBetween(base, state.world_from_board[k]);
  }
  return geometry::Perturb(motion, base);
}

/// Coefficients (6, N) of t, t^2, … of the polynomial through the pose of frame `f`, at t = 0, and those of `nodes`.
Eigen::Matrix<double, 6, Eigen::Dynamic> MotionPolynomial(const RigState& state, const std::vector<size_t>& nodes, size_t f) {
  const auto n = static_cast<Eigen::Index>(nodes.size());
  Eigen::MatrixXd powers(n, n), motions(n, 6);
  for (Eigen::Index k = 0; k < n; ++k) {
    const size_t node = nodes[static_cast<size_t>(k)];
    const double t = static_cast<double>(state.frames[node] - state.frames[f]);
    for (Eigen::Index power = 0; power < n; ++power) powers(k, power) = std::pow(t, static_cast<double>(power + 1));
    motions.row(k) = MotionBetween(state.world_from_board[f], state.world_from_board[node]).transpose();
  }
  return powers.partialPivLu().solve(motions).transpose();
}

}  // namespace

void EstimateMotion(const std::vector<View>& views, RigState* state) {
  const size_t n = state->frames.size();
  std::vector<bool> seen(n, false);
  for (const View& view : views) seen[view.frame] = seen[view.frame] || (view.weights.array() > 0).any();
  state->board_velocity.assign(n, geometry::Vector6d::Zero());
  state->board_acceleration.assign(n, geometry::Vector6d::Zero());
  for (size_t f = 0; f < n; ++f) {
    const std::vector<size_t> nodes = MotionNodes(state->frames, seen, state->motion, f);
    if (nodes.empty()) continue;
    if (!seen[f]) state->world_from_board[f] = PoseBetween(*state, nodes, f);
    const auto polynomial = MotionPolynomial(*state, nodes, f);
    state->board_velocity[f] = polynomial.col(0);
    if (polynomial.cols() > 1) state->board_acceleration[f] = 2 * polynomial.col(1);
  }
}

std::vector<Eigen::Matrix2Xd> BundleResiduals(const std::vector<View>& views, const RigState& state) {
  std::vector<Eigen::Matrix2Xd> all;
  for (const View& view : views) {
    View any = view;
    any.weights.setZero();  // so that corners that do not project give infinity
    const Eigen::Matrix3Xd corners = BentCorners(view, state);
    all.push_back(*ResidualsOf(any, state.cameras[view.camera_idx], CamFromBoard(view, state), &corners));
  }
  return all;
}

namespace {

Status Iterate(std::vector<View>* views, RigState* state, const BundleOptions& options, const Priors& prior,
               BundleReport* report) {
  const bool each = options.each_camera_noise;
  for (double scale : kRobustScales) {
    if (!options.reject_outliers) break;
    SetRobustWeights(*state, prior, scale, each, views);
    if (SolveOnce(*views, options, kRobustTolerance, state, &report->num_iterations) == Status::kUndefined)
      return Status::kUndefined;
  }
  for (size_t v = 0; v < views->size(); ++v) (*views)[v].weights = prior[v];
  for (int round = 0; options.reject_outliers && round < kRejectRounds; ++round) {
    const int changes = SetRejections(*state, prior, options.reject_sigmas, each, views);
    if (round > 0 && changes == 0) break;
    if (SolveOnce(*views, options, kRejectTolerance, state, &report->num_iterations) == Status::kUndefined)
      return Status::kUndefined;
  }
  const Status status = SolveOnce(*views, options, options.cost_tolerance, state, &report->num_iterations);
  // The last digits may let corners back in (without noise, hundreds).
  if (status != Status::kOk || !options.reject_outliers) return status;
  if (SetRejections(*state, prior, options.reject_sigmas, each, views) == 0) return status;
  return SolveOnce(*views, options, options.cost_tolerance, state, &report->num_iterations);
}

}  // namespace

BundleReport internal::Failed(Status status, const std::string& message) {
  BundleReport report;
  report.status = status;
  report.message = message;
  return report;
}

std::optional<BundleReport> internal::CheckInput(const std::vector<View>& views, const RigState& state) {
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

BundleReport SolveBundle(std::vector<View>* views, RigState* state, const BundleOptions& options) {
  if (const auto failed = internal::CheckInput(*views, *state)) return *failed;
  Priors prior;
  for (const View& view : *views) prior.push_back(view.weights);
  BundleReport report;
  const Eigen::Vector3d centre = FarCentre(*state);
  MoveOrigin(centre, state);
  report.status = Iterate(views, state, options, prior, &report);
  MoveOrigin(-centre, state);
  if (report.status == Status::kUndefined)
    return internal::Failed(Status::kBehindCamera, "the start of the adjustment puts corners behind a camera");
  if (report.status != Status::kOk) report.message = "the adjustment did not reach its tolerance";
  Summarize(*views, *state, options, prior, &report);
  return report;
}

}  // namespace mvstudio::calib
