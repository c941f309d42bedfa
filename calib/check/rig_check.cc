#include "calib/check/rig_check.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "calib/check/check_steps.h"
#include "calib/check/pose_problem.h"
#include "core/error.h"
#include "core/join.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;
using geometry::Vector6d;
using internal::CheckWork;
using internal::CornerDistances;
using internal::FreeCamera;
using internal::PoseProblem;
using internal::PoseState;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kTie = 0.8;  // a rival reaches this fraction of the best one's gain

/// Places a board where the view that the others agree with best sees it.
Rigid3 StartOfBoard(const CheckWork& work, int board) {
  PoseState trial = work.state;
  Rigid3 best;
  double best_cost = kInfinity;
  for (const int v : work.problem.views_of_board[static_cast<size_t>(board)]) {
    const size_t camera = static_cast<size_t>(work.problem.views[static_cast<size_t>(v)].camera_idx);
    trial.world_from_board[static_cast<size_t>(board)] =
        Inverse(trial.cam_from_world[camera]) * work.own_pose[static_cast<size_t>(v)];
    const double cost = internal::BoardsCost(work.problem, trial, {board});
    if (!(cost < best_cost) && best_cost < kInfinity) continue;
    best_cost = cost;
    best = trial.world_from_board[static_cast<size_t>(board)];
  }
  return best;
}

/// A camera set free in `state`.
struct Trial {
  FreeCamera solution;
  PoseState state;
  double gain = 0;  ///< how much lower the cost of its boards is
  double left = 0;  ///< cost of its own views
};

/// The camera's boards that a second one sees.
std::vector<int> SharedBoards(const CheckWork& work, int camera) {
  std::vector<int> boards;
  for (const int board : work.boards_of[static_cast<size_t>(camera)]) {
    if (work.problem.views_of_board[static_cast<size_t>(board)].size() > 1) boards.push_back(board);
  }
  return boards;
}

/// From the pose it has, and from where one of its views puts it if that is better.
Trial SetFree(const CheckWork& work, int camera) {
  constexpr size_t kMaxStarts = 8;
  Trial trial;
  trial.state = work.state;
  const std::vector<int> boards = SharedBoards(work, camera);
  if (boards.empty()) {
    trial.solution.status = Status::kTooFewViews;
    return trial;
  }
  const double before = internal::BoardsCost(work.problem, work.state, boards);
  PoseState start = work.state;
  double start_cost = before;
  const size_t stride = (boards.size() + kMaxStarts - 1) / kMaxStarts;
  for (size_t i = 0; i < boards.size(); i += stride) {
    for (const int v : work.problem.views_of_board[static_cast<size_t>(boards[i])]) {
      if (work.problem.views[static_cast<size_t>(v)].camera_idx != camera) continue;
      PoseState other = work.state;
      other.cam_from_world[static_cast<size_t>(camera)] =
          work.own_pose[static_cast<size_t>(v)] * Inverse(work.state.world_from_board[static_cast<size_t>(boards[i])]);
      const double cost = internal::BoardsCost(work.problem, other, boards);
      if (cost < start_cost) start = other, start_cost = cost;
    }
  }
  trial.state = start;
  trial.solution = internal::SolveCamera(work.problem, boards, camera, &trial.state);
  trial.gain = before - trial.solution.cost;
  for (const int board : boards) trial.left += internal::OwnCost(work.problem, trial.state, camera, board);
  return trial;
}

/// Motion of a camera's pose against the calibration, with its standard deviations.
void Describe(const Trial& trial, const CheckWork& work, int camera, CameraCheck* check) {
  const size_t c = static_cast<size_t>(camera);
  check->status = trial.solution.status;
  const Rigid3& old_pose = work.rig.cameras[c].cam_from_world;
  const Rigid3& new_pose = trial.state.cam_from_world[c];
  check->cam_from_world = new_pose;
  if (check->status != Status::kOk) return;
  const auto& covariance = trial.solution.covariance;
  Vector6d motion;
  motion << geometry::RotationLog(new_pose.rotation * old_pose.rotation.conjugate()),
      new_pose.translation - old_pose.translation;
  check->significance = std::sqrt(motion.dot(covariance.ldlt().solve(motion)) / 6);
  const auto sigma_along = [](const Eigen::Matrix3d& cov, const Eigen::Vector3d& along) {
    const double length = along.norm();
    return length > 0 ? std::sqrt(along.dot(cov * along)) / length : std::sqrt(cov.trace() / 3);
  };
  check->rotation_rad = motion.head<3>().norm();
  check->rotation_sigma_rad = sigma_along(covariance.topLeftCorner<3, 3>(), motion.head<3>());
  // The centre -R^T t moves by R^T (w x t - v) under a perturbation (w, v).
  const Eigen::Vector3d& t = new_pose.translation;
  Eigen::Matrix<double, 3, 6> j;
  j << 0, t.z(), -t.y(), -1, 0, 0, -t.z(), 0, t.x(), 0, -1, 0, t.y(), -t.x(), 0, 0, 0, -1;
  const Eigen::Vector3d shift = new_pose.rotation * (Inverse(new_pose).translation - Inverse(old_pose).translation);
  check->translation_m = shift.norm();
  check->translation_sigma_m = sigma_along(j * covariance * j.transpose(), shift);
}

/// The camera set free and described.
Trial Examine(CheckWork* work, int camera) {
  internal::HearVoters(camera, work);
  Trial trial = SetFree(*work, camera);
  CameraCheck& check = work->checks[static_cast<size_t>(camera)];
  Describe(trial, *work, camera, &check);
  check.is_visible = internal::ShowsInResiduals(trial.gain, trial.left, work->options.bump_sigmas);
  if (check.status == Status::kOk) {
    check.shift_px = internal::ShiftPx(*work, trial.state, camera,
                                       work->rig.cameras[static_cast<size_t>(camera)].cam_from_world, check.cam_from_world);
  }
  return trial;
}

bool HasMoved(const CameraCheck& check, const RigCheckOptions& options) {
  return check.status == Status::kOk && check.significance > options.bump_sigmas && check.shift_px > options.bump_px &&
         check.is_visible;
}

/// Boards where the cameras that stayed see them.
void PlaceBoards(CheckWork* work) {
  internal::HearVoters(-1, work);
  for (size_t b = 0; b < work->problem.views_of_board.size(); ++b) {
    if (!work->problem.views_of_board[b].empty()) internal::SolveBoards(work->problem, {static_cast<int>(b)}, &work->state);
  }
}

void PlaceBoardsAnew(CheckWork* work) {
  work->state.world_from_board.resize(work->problem.views_of_board.size());
  for (size_t b = 0; b < work->problem.views_of_board.size(); ++b)
    work->state.world_from_board[b] = StartOfBoard(*work, static_cast<int>(b));
  PlaceBoards(work);
}

/// The one camera whose freedom explains most joins those that have moved; false when none did or it cannot be told which.
bool FindNextMoved(CheckWork* work, RigCheck* result) {
  std::map<int, Trial> trials;
  int best = -1;
  for (size_t c = 0; c < work->checks.size(); ++c) {
    if (!work->present[c] || work->moved[c]) continue;
    const int camera = static_cast<int>(c);
    const Trial& trial = trials[camera] = Examine(work, camera);
    if (!HasMoved(work->checks[c], work->options)) continue;
    if (best < 0 || trial.gain > trials[best].gain) best = camera;
  }
  if (best < 0) return false;
  // A camera is a rival if its motion becomes insignificant once the best candidate is freed.
  const PoseState before = work->state;
  for (const auto& [camera, trial] : trials) {
    CameraCheck& check = work->checks[static_cast<size_t>(camera)];
    if (camera == best || !HasMoved(check, work->options) || trial.gain < kTie * trials[best].gain) continue;
    const CameraCheck alone = check;
    work->moved[static_cast<size_t>(best)] = true;
    PlaceBoards(work);
    Examine(work, camera);
    if (!HasMoved(check, work->options)) result->undecided.push_back(check.name);
    check = alone;
    work->moved[static_cast<size_t>(best)] = false;
    work->state = before;
  }
  if (!result->undecided.empty()) {
    result->undecided.push_back(work->checks[static_cast<size_t>(best)].name);
    std::sort(result->undecided.begin(), result->undecided.end());
    return false;
  }
  work->moved[static_cast<size_t>(best)] = true;
  PlaceBoards(work);
  return true;
}

/// What was found to have moved is only as good as two cameras that agree with each other.
void RequireConsensus(CheckWork* work, RigCheck* result) {
  const bool any = std::find(work->moved.begin(), work->moved.end(), true) != work->moved.end();
  const bool either = result->two_cameras && any && result->undecided.empty();
  if (result->undecided.empty() && !either) return;
  int agreeing = 0;
  for (size_t c = 0; c < work->checks.size(); ++c) {
    const auto& unsure = result->undecided;
    const bool is_unsure = std::find(unsure.begin(), unsure.end(), work->checks[c].name) != unsure.end();
    agreeing += work->present[c] && !work->moved[c] && !is_unsure && !work->boards_of[c].empty();
  }
  if (agreeing >= 2) return;
  for (size_t c = 0; c < work->checks.size(); ++c) {
    if (work->moved[c] || (either && work->present[c])) result->undecided.push_back(work->checks[c].name);
    work->moved[c] = false;
  }
  std::sort(result->undecided.begin(), result->undecided.end());
}

/// Two cameras cannot tell a wrong scale from a wrong baseline; more can: boards take the scale that the pairs agree on. Those
/// of two cameras do where `two_as_well`.
void TakeScale(const std::vector<Board>& boards, bool two_as_well, CheckWork* work, RigCheck* result) {
  result->scale = internal::MeasureScale(boards, *work);
  result->two_cameras = std::count(work->present.begin(), work->present.end(), true) < 3;
  if (result->two_cameras && !two_as_well) return;
  if (!(std::abs(result->scale - 1) > work->options.scale_percent / 100)) return;
  for (View& view : work->problem.views) view.x_in_board *= result->scale;
  for (Rigid3& pose : work->own_pose) pose.translation *= result->scale;
}

/// `stated` receives the covariances of the new poses.
void Solve(const RunContext& run, CheckWork* work, RigCheck* result, geometry::StatedCovariance* stated) {
  const int64_t present = std::count(work->present.begin(), work->present.end(), true);
  ProgressStage stage(run, "checking cameras", present);
  PlaceBoardsAnew(work);
  for (int64_t i = 0; i < present && FindNextMoved(work, result); ++i) stage.Advance(1);
  RequireConsensus(work, result);
  PlaceBoards(work);
  for (size_t c = 0; c < work->checks.size(); ++c) {
    if (!work->moved[c]) continue;
    const int camera = static_cast<int>(c);
    const Trial trial = Examine(work, camera);
    result->moved.push_back(work->checks[c].name);
    stated->pose_known[c] = false;
    if (stated->AnyKnown() && trial.solution.status == Status::kOk)
      internal::CarryIntoRepair(*work, trial.state, SharedBoards(*work, camera), camera, trial.solution.covariance, stated);
  }
  internal::HearVoters(-1, work);
}

CheckWork WorkFor(const geometry::Rig& rig, const CalibrateInput& input, const RigCheckOptions& options) {
  CheckWork work = internal::PrepareCheck(rig, options, input);
  work.present.assign(rig.cameras.size(), false);
  for (const CameraInput& camera : input.cameras) work.present[static_cast<size_t>(rig.Find(camera.name))] = true;
  return work;
}

/// Boards where the cameras as calibrated put the corners that were seen at these times.
CheckWork PlacedAt(const geometry::Rig& rig, const CalibrateInput& seen, const std::vector<geometry::TimeOffset>& late,
                   const RigCheckOptions& options) {
  CheckWork work = WorkFor(rig, AtFrameTimes(seen, late), options);
  work.all_views_of_board = work.problem.views_of_board;
  PlaceBoardsAnew(&work);
  return work;
}

RigCheck CheckWithBoards(const geometry::Rig& rig, const CalibrateInput& input, bool two_take_scale,
                         const RigCheckOptions& options, const RunContext& run) {
  RigCheck result;
  result.repaired = rig;
  geometry::StatedCovariance stated = geometry::StatedCovarianceOf(rig);
  CheckWork work = WorkFor(rig, input, options);
  result.num_boards = static_cast<int>(work.problem.views_of_board.size());
  internal::CheckLensesAlone(&work);
  const bool has_boards = !work.problem.views_of_board.empty();
  if (!has_boards && !internal::IsOneLens(work)) {
    result.status = Status::kTooFewViews;
    result.message = "no two cameras see a board at the same time step, and the lens of one camera alone needs " +
                     std::to_string(LensCheck::kFewestViews) + " boards to be checked";
  } else if (has_boards) {
    work.all_views_of_board = work.problem.views_of_board;
    result.board_metrics = internal::MeasureLengths(input.boards, work);
    TakeScale(input.boards, two_take_scale, &work, &result);
    Solve(run, &work, &result, &stated);
    internal::KeepIfBetter(rig, &work, &result);
    PlaceBoards(&work);
  }
  internal::FillResiduals(work, &result);
  for (size_t c = 0; c < work.checks.size(); ++c) {
    if (work.moved[c]) result.repaired.cameras[c].cam_from_world = work.checks[c].cam_from_world;
  }
  if (!result.moved.empty()) geometry::StoreCovariance(stated, &result.repaired);
  return result;
}

/// The check of corners that need no more correction. Of two cameras that stand farther apart than they did, boards of another
/// size look the same: where these explain all, none is said to have moved.
RigCheck CheckSeen(const geometry::Rig& rig, const CalibrateInput& input, const RigCheckOptions& options,
                   const RunContext& run) {
  RigCheck check = CheckWithBoards(rig, input, false, options, run);
  if (!check.two_cameras || check.undecided.empty() || !(std::abs(check.scale - 1) > options.scale_percent / 100)) return check;
  RigCheck scaled = CheckWithBoards(rig, input, true, options, run);
  return scaled.undecided.empty() ? scaled : check;
}

/// Where a camera seems to have moved: the check with the corners of two cameras exchanged, if that explains it.
std::optional<RigCheck> CheckWhenExchanged(const geometry::Rig& rig, const CalibrateInput& seen, const RigCheck& check,
                                           const RigCheckOptions& options, const RunContext& run) {
  const bool agrees = check.moved.empty() && check.undecided.empty() && !(check.rms_px > options.warn_px);
  if (check.status != Status::kOk || agrees) return std::nullopt;
  const auto pair = internal::FindExchanged(seen, check, [&](const CalibrateInput& input) {
    CheckWork work = PlacedAt(rig, input, {}, options);
    RigCheck trial;
    internal::KeepIfBetter(rig, &work, &trial);
    return trial.cost;
  });
  if (!pair) return std::nullopt;
  RigCheck then = CheckSeen(rig, internal::WithExchanged(seen, pair->first, pair->second), options, run);
  if (!then.moved.empty() || !then.undecided.empty()) return std::nullopt;
  then.exchanged = {seen.cameras[pair->first].name, seen.cameras[pair->second].name};
  then.found = check.found;
  return then;
}

/// Where a camera seems to have moved: the check at times that the calibration does not state, if these explain it.
std::optional<RigCheck> CheckWhenLate(const geometry::Rig& rig, const CalibrateInput& seen, const RigCheck& check,
                                      const RigCheckOptions& options, const RunContext& run) {
  constexpr double kLessCost = 0.7;
  if (check.status != Status::kOk || (check.moved.empty() && check.undecided.empty())) return std::nullopt;
  const auto place = [&](const std::vector<geometry::TimeOffset>& at) { return PlacedAt(rig, seen, at, options); };
  const std::vector<geometry::TimeOffset> late = internal::FindTimeOffsets(seen, place);
  if (late.empty()) return std::nullopt;
  RigCheck then = CheckSeen(rig, AtFrameTimes(seen, late), options, run);
  if (!then.moved.empty() || !then.undecided.empty() || !(then.cost < kLessCost * check.cost)) return std::nullopt;
  for (size_t c = 0; c < late.size(); ++c) {
    if (late[c].frames != 0) then.late.push_back({seen.cameras[c].name, late[c].frames});
  }
  then.offsets_stated = check.offsets_stated, then.found = check.found;
  return then;
}

}  // namespace

RigCheck CheckRig(const geometry::Rig& rig, const CalibrateInput& input, const RigCheckOptions& options,
                  const RunContext& run) {
  std::vector<CameraParts> ways = {CameraParts::kByFrame};
  if (HasParts(rig, input)) ways.push_back(CameraParts::kLast);
  constexpr double kClearlyLess = 0.999;  // boards at rest agree with any time
  std::optional<RigCheck> best;
  CalibrateInput best_seen;
  for (const CameraParts parts : ways) {
    CornerFindings findings;
    const CalibrateInput seen = SeenCorners(rig, input, parts, &findings);
    if (seen.cameras.size() < 2 && !findings.unknown.empty())
      throw UsageError("camera " + Join(findings.unknown, ", ") + " is not in the calibration, which has " +
                       Join(geometry::CameraNames(rig), ", "));
    const std::vector<geometry::TimeOffset> late = StatedTimeOffsets(rig, seen);
    for (const bool stated : {true, false}) {
      if (stated && late.empty()) continue;
      RigCheck check = CheckSeen(rig, stated ? AtFrameTimes(seen, late) : seen, options, run);
      check.offsets_stated = !late.empty(), check.offsets_used = stated;
      check.found = findings;
      if (best && !(check.cost < kClearlyLess * best->cost)) continue;
      best = std::move(check), best_seen = seen;
    }
  }
  auto otherwise = CheckWhenExchanged(rig, best_seen, *best, options, run);
  if (!otherwise) otherwise = CheckWhenLate(rig, best_seen, *best, options, run);
  if (otherwise) best = std::move(otherwise);
  internal::JudgeCheck(options, &*best);
  return std::move(*best);
}

}  // namespace mvstudio::calib
