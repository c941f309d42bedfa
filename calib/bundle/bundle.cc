#include "calib/bundle/bundle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

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
    (*views)[v].weights = noise.weight[c] * prior[v].array() / (1 + (distances[v] / (sigmas * noise.limit_px[c])).array().square());
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

void Summarize(const std::vector<View>& views, const RigState& state, const BundleOptions& options,
               const Priors& prior, BundleReport* report) {
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

namespace {

/// The two frames whose difference is the motion in frame `f`: the nearest seen ones before and after it, or else two that are
/// nearest; nothing where fewer are near enough.
std::optional<std::pair<size_t, size_t>> MotionNeighbours(const std::vector<int64_t>& frames, const std::vector<bool>& seen,
                                                          size_t f) {
  constexpr int64_t kReach = 2;  // frames
  const auto next = [&](size_t from, int direction) {
    for (size_t g = from + direction; g < frames.size() && std::llabs(frames[g] - frames[f]) <= kReach; g += direction) {
      if (seen[g]) return g;
    }
    return frames.size();
  };
  const size_t none = frames.size(), before = next(f, -1), after = next(f, 1);
  if (before != none && after != none) return std::make_pair(before, after);
  if (before == none && after == none) return std::nullopt;
  const size_t side = before != none ? before : after;
  const size_t other = seen[f] ? f : next(side, before != none ? -1 : 1);
  if (other == none) return std::nullopt;
  return std::make_pair(std::min(side, other), std::max(side, other));
}

/// Of the board from one frame to another, per frame: what turns its pose (left) and shifts its origin.
geometry::Vector6d MeanVelocity(const RigState& state, size_t from, size_t to) {
  const double frames = static_cast<double>(state.frames[to] - state.frames[from]);
  const Rigid3 &a = state.world_from_board[from], &b = state.world_from_board[to];
  geometry::Vector6d velocity;
  velocity << geometry::RotationLog(b.rotation * a.rotation.conjugate()) / frames, (b.translation - a.translation) / frames;
  return velocity;
}

}  // namespace

void EstimateMotion(const std::vector<View>& views, RigState* state) {
  const size_t n = state->frames.size();
  std::vector<bool> seen(n, false);
  for (const View& view : views) seen[view.frame] = seen[view.frame] || (view.weights.array() > 0).any();
  state->board_velocity.assign(n, geometry::Vector6d::Zero());
  state->board_acceleration.assign(n, geometry::Vector6d::Zero());
  for (size_t f = 0; f < n; ++f) {
    const auto neighbours = MotionNeighbours(state->frames, seen, f);
    if (!neighbours) continue;
    const auto [before, after] = *neighbours;
    geometry::Vector6d& velocity = state->board_velocity[f];
    velocity = MeanVelocity(*state, before, after);
    if (!seen[f]) {
      const double step = static_cast<double>(state->frames[f] - state->frames[before]);
      state->world_from_board[f] = geometry::Perturb(step * velocity, state->world_from_board[before]);
    } else if (before < f && f < after) {  // the parabola through the three
      const double to = static_cast<double>(state->frames[f] - state->frames[before]),
                   from = static_cast<double>(state->frames[after] - state->frames[f]);
      const geometry::Vector6d first = MeanVelocity(*state, before, f), second = MeanVelocity(*state, f, after);
      velocity = (from * first + to * second) / (from + to);
      state->board_acceleration[f] = 2 * (second - first) / (from + to);
    }
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

BundleReport SolveBundle(std::vector<View>* views, RigState* state, const BundleOptions& options) {
  if (const auto failed = CheckInput(*views, *state)) return *failed;
  Priors prior;
  for (const View& view : *views) prior.push_back(view.weights);
  BundleReport report;
  const Eigen::Vector3d centre = FarCentre(*state);
  MoveOrigin(centre, state);
  report.status = Iterate(views, state, options, prior, &report);
  MoveOrigin(-centre, state);
  if (report.status == Status::kUndefined)
    return Failed(Status::kBehindCamera, "the start of the adjustment puts corners behind a camera");
  if (report.status != Status::kOk) report.message = "the adjustment did not reach its tolerance";
  Summarize(*views, *state, options, prior, &report);
  return report;
}

}  // namespace mvstudio::calib
