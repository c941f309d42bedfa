#include "calib/check/camera_motion.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "calib/check/check_steps.h"
#include "calib/check/pose_problem.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;
using geometry::Vector6d;
using internal::CheckWork;
using internal::Matrix6d;
using internal::PoseState;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMinSignificance = 5, kMinShiftPx = 0.3;
constexpr double kTie = 0.8;  // a rival reaches this fraction of the best one's gain
constexpr int kMaxStretches = 12, kBoardsOfStretch = 3;
constexpr size_t kMaxStarts = 4, kMinSteady = 5;
constexpr double kSteadier = 1.5;  // a cut is what a user can act on

/// The pose of one camera in one interval of time.
struct StretchPose {
  std::vector<int> boards;
  Rigid3 cam_from_world;
  Matrix6d information = Matrix6d::Zero();
};

/// One camera's change between two stretches.
struct Change {
  int camera = -1;
  std::vector<int> before, after;  // boards
  Rigid3 pose_before, pose_after;
  double rotation_sigma_rad = 0, significance = 0, gain = 0, shift_px = 0;
  bool steady = false;  // from the first board to the last
};

int64_t FrameOf(const CheckWork& work, int board) {
  return work.problem.views[static_cast<size_t>(work.all_views_of_board[static_cast<size_t>(board)][0])].frame;
}

/// Boards where the voters see them, from the view that agrees best with the others.
void PlaceBoards(CheckWork* work) {
  for (size_t b = 0; b < work->problem.views_of_board.size(); ++b) {
    const std::vector<int>& views = work->problem.views_of_board[b];
    if (views.empty()) continue;
    Rigid3 best = work->state.world_from_board[b];
    double best_cost = kInfinity;
    for (int v : views) {
      const int camera = work->problem.views[static_cast<size_t>(v)].camera_idx;
      work->state.world_from_board[b] =
          Inverse(work->state.cam_from_world[static_cast<size_t>(camera)]) * work->own_pose[static_cast<size_t>(v)];
      const double cost = internal::BoardsCost(work->problem, work->state, {static_cast<int>(b)});
      if (cost < best_cost) best_cost = cost, best = work->state.world_from_board[b];
    }
    work->state.world_from_board[b] = best;
    internal::SolveBoards(work->problem, {static_cast<int>(b)}, &work->state);
  }
}

/// The camera's pose from some boards, starting at its current pose or at that of one of its own views.
std::optional<StretchPose> PoseBy(const CheckWork& work, int camera, const std::vector<int>& boards) {
  PoseState state = work.state, best = work.state;
  double best_cost = internal::BoardsCost(work.problem, state, boards);
  const size_t stride = (boards.size() + kMaxStarts - 1) / kMaxStarts;
  for (size_t i = 0; i < boards.size(); i += stride) {
    for (int v : work.problem.views_of_board[static_cast<size_t>(boards[i])]) {
      if (work.problem.views[static_cast<size_t>(v)].camera_idx != camera) continue;
      state.cam_from_world[static_cast<size_t>(camera)] =
          work.own_pose[static_cast<size_t>(v)] * Inverse(work.state.world_from_board[static_cast<size_t>(boards[i])]);
      const double cost = internal::BoardsCost(work.problem, state, boards);
      if (cost < best_cost) best_cost = cost, best = state;
    }
  }
  const internal::FreeCamera solved = internal::SolveCamera(work.problem, boards, camera, &best);
  if (solved.status != Status::kOk) return std::nullopt;
  StretchPose pose{boards, best.cam_from_world[static_cast<size_t>(camera)], Matrix6d::Zero()};
  pose.information = solved.covariance.ldlt().solve(Matrix6d::Identity());
  return pose;
}

/// The camera's boards that another voter sees, in the order of time.
std::vector<int> SharedBoards(const CheckWork& work, int camera) {
  std::vector<int> boards;
  for (int board : work.boards_of[static_cast<size_t>(camera)]) {
    if (work.problem.views_of_board[static_cast<size_t>(board)].size() > 1) boards.push_back(board);
  }
  std::stable_sort(boards.begin(), boards.end(), [&](int a, int b) { return FrameOf(work, a) < FrameOf(work, b); });
  return boards;
}

std::vector<StretchPose> PosesOverTime(const CheckWork& work, int camera) {
  const std::vector<int> boards = SharedBoards(work, camera);
  const int stretches = std::min(kMaxStretches, static_cast<int>(boards.size()) / kBoardsOfStretch);
  std::vector<StretchPose> poses;
  for (int s = 0; s < stretches; ++s) {
    const auto at = [&](int k) { return boards.begin() + static_cast<std::ptrdiff_t>(boards.size()) * k / stretches; };
    auto pose = PoseBy(work, camera, std::vector<int>(at(s), at(s + 1)));
    if (pose) poses.push_back(std::move(*pose));
  }
  return poses;
}

/// From one pose to another as a left perturbation.
Vector6d Step(const Rigid3& from, const Rigid3& to) {
  Vector6d step;
  step << geometry::RotationLog(to.rotation * from.rotation.conjugate()), to.translation - from.translation;
  return step;
}

/// Mean of some poses, their information, and how much they scatter about it (chi-square).
struct Segment {
  Vector6d mean = Vector6d::Zero();
  Matrix6d information = Matrix6d::Zero();
  double scatter = 0;
};

Segment MeanOf(const std::vector<StretchPose>& poses, size_t first, size_t last) {
  Segment segment;
  Vector6d sum = Vector6d::Zero();
  for (size_t i = first; i < last; ++i) {
    segment.information += poses[i].information;
    sum += poses[i].information * Step(poses[0].cam_from_world, poses[i].cam_from_world);
  }
  segment.mean = segment.information.ldlt().solve(sum);
  for (size_t i = first; i < last; ++i) {
    const Vector6d off = Step(poses[0].cam_from_world, poses[i].cam_from_world) - segment.mean;
    segment.scatter += off.dot(poses[i].information * off);
  }
  return segment;
}

/// RMS shift of the camera's corners between two poses.
double ShiftPx(const CheckWork& work, const std::vector<int>& boards, int camera, const Rigid3& a, const Rigid3& b) {
  const geometry::Projector projector(work.problem.cameras[static_cast<size_t>(camera)]);
  double sum = 0;
  int count = 0;
  for (int board : boards) {
    for (int v : work.problem.views_of_board[static_cast<size_t>(board)]) {
      const View& view = work.problem.views[static_cast<size_t>(v)];
      if (view.camera_idx != camera) continue;
      for (Eigen::Index i = 0; i < view.size(); ++i) {
        const Eigen::Vector3d x =
            work.state.world_from_board[static_cast<size_t>(board)] * Eigen::Vector3d(view.x_in_board.col(i));
        const geometry::Projection pa = projector.Project(a * x), pb = projector.Project(b * x);
        if (pa.status != Status::kOk || pb.status != Status::kOk) continue;
        sum += (pa.px - pb.px).squaredNorm();
        ++count;
      }
    }
  }
  return count > 0 ? std::sqrt(sum / count) : kInfinity;
}

/// Cost of one board with the camera in a pose.
double CostWith(const CheckWork& work, int camera, int board, const Rigid3& pose, PoseState* scratch) {
  scratch->cam_from_world[static_cast<size_t>(camera)] = pose;
  scratch->world_from_board[static_cast<size_t>(board)] = work.state.world_from_board[static_cast<size_t>(board)];
  internal::SolveBoards(work.problem, {board}, scratch);
  return internal::BoardsCost(work.problem, *scratch, {board});
}

/// Moves the cut to the board where it explains most.
void RefineCut(const CheckWork& work, Change* change) {
  std::vector<int> boards = change->before;
  boards.insert(boards.end(), change->after.begin(), change->after.end());
  PoseState scratch = work.state;
  double sum = 0, best = 0;
  size_t cut = 0;
  for (size_t i = 0; i < boards.size(); ++i) {
    sum += CostWith(work, change->camera, boards[i], change->pose_before, &scratch) -
           CostWith(work, change->camera, boards[i], change->pose_after, &scratch);
    if (sum < best) best = sum, cut = i + 1;
  }
  if (cut < 2 || cut + 2 > boards.size()) return;
  change->before.assign(boards.begin(), boards.begin() + static_cast<std::ptrdiff_t>(cut));
  change->after.assign(boards.begin() + static_cast<std::ptrdiff_t>(cut), boards.end());
}

/// Poses that change in proportion to time, t from 0 to 1: what the change explains for what the poses scatter about it.
std::optional<Change> SteadyChange(const CheckWork& work, int camera, const std::vector<StretchPose>& poses) {
  if (poses.size() < kMinSteady) return std::nullopt;
  const auto time = [&](size_t i) {
    double sum = 0;
    for (int board : poses[i].boards) sum += static_cast<double>(FrameOf(work, board));
    return sum / static_cast<double>(poses[i].boards.size());
  };
  const double first = time(0), span = time(poses.size() - 1) - first;
  if (!(span > 0)) return std::nullopt;
  using Matrix12d = Eigen::Matrix<double, 12, 12>;
  Matrix12d normal = Matrix12d::Zero();
  Eigen::Matrix<double, 12, 1> right = Eigen::Matrix<double, 12, 1>::Zero();
  for (size_t i = 0; i < poses.size(); ++i) {
    const double t = (time(i) - first) / span;
    Eigen::Matrix<double, 6, 12> by;
    by << Matrix6d::Identity(), t * Matrix6d::Identity();
    normal += by.transpose() * poses[i].information * by;
    right += by.transpose() * poses[i].information * Step(poses[0].cam_from_world, poses[i].cam_from_world);
  }
  const Matrix12d covariance = normal.inverse();
  const Eigen::Matrix<double, 12, 1> line = covariance * right;
  double scatter = 0;
  for (size_t i = 0; i < poses.size(); ++i) {
    const Vector6d off =
        Step(poses[0].cam_from_world, poses[i].cam_from_world) - line.head<6>() - (time(i) - first) / span * line.tail<6>();
    scatter += off.dot(poses[i].information * off);
  }
  const double widening = std::max(1.0, scatter / (6.0 * (static_cast<double>(poses.size()) - 2)));
  const Vector6d slope = line.tail<6>();
  const Matrix6d slope_covariance = covariance.bottomRightCorner<6, 6>();
  Change change;
  change.camera = camera;
  change.gain = slope.dot(slope_covariance.ldlt().solve(slope)) / widening;
  change.significance = std::sqrt(change.gain / 6);
  change.before = poses.front().boards, change.after = poses.back().boards;
  change.pose_before = geometry::Perturb(line.head<6>(), poses[0].cam_from_world);
  change.pose_after = geometry::Perturb(line.head<6>() + slope, poses[0].cam_from_world);
  const Eigen::Vector3d axis = slope.head<3>().normalized();
  change.rotation_sigma_rad = std::sqrt(widening * axis.dot(slope_covariance.topLeftCorner<3, 3>() * axis));
  change.steady = true;
  return change;
}

/// The cut that divides the poses best, or the steady change where that explains more.
std::optional<Change> LargestChange(const CheckWork& work, int camera) {
  const std::vector<StretchPose> poses = PosesOverTime(work, camera);
  std::optional<Change> largest;
  for (size_t cut = 1; cut < poses.size(); ++cut) {
    const Segment a = MeanOf(poses, 0, cut), b = MeanOf(poses, cut, poses.size());
    const double freedom = 6.0 * (static_cast<double>(poses.size()) - 2);
    const double widening = freedom > 0 ? std::max(1.0, (a.scatter + b.scatter) / freedom) : 1;
    const Matrix6d covariance = a.information.inverse() + b.information.inverse();
    const Vector6d step = b.mean - a.mean;
    const double gain = step.dot(covariance.ldlt().solve(step)) / widening;
    if (!(gain > (largest ? largest->gain : 0))) continue;
    Change change{camera,
                  {},
                  {},
                  geometry::Perturb(a.mean, poses[0].cam_from_world),
                  geometry::Perturb(b.mean, poses[0].cam_from_world),
                  0,
                  std::sqrt(gain / 6),
                  gain,
                  0};
    for (size_t i = 0; i < poses.size(); ++i) {
      std::vector<int>& side = i < cut ? change.before : change.after;
      side.insert(side.end(), poses[i].boards.begin(), poses[i].boards.end());
    }
    const Eigen::Vector3d axis = step.head<3>().normalized();
    change.rotation_sigma_rad = std::sqrt(widening * axis.dot(covariance.topLeftCorner<3, 3>() * axis));
    largest = change;
  }
  if (!largest) return largest;
  const auto steady = SteadyChange(work, camera, poses);
  if (steady && steady->gain > kSteadier * largest->gain) largest = steady;
  std::vector<int> all = largest->before;
  all.insert(all.end(), largest->after.begin(), largest->after.end());
  largest->shift_px = ShiftPx(work, all, camera, largest->pose_before, largest->pose_after);
  return largest;
}

/// Whether the residuals of the rig as it is show the change: poses of single stretches may be far off for other reasons, above
/// all where a board turns little.
bool ShowsInResiduals(const CheckWork& work, const Change& change) {
  PoseState scratch = work.state;
  double gain = 0, left = 0;
  for (const bool later : {false, true}) {
    for (int board : later ? change.after : change.before) {
      gain += internal::BoardsCost(work.problem, work.state, {board});
      gain -= CostWith(work, change.camera, board, later ? change.pose_after : change.pose_before, &scratch);
      left += internal::OwnCost(work.problem, scratch, change.camera, board);
    }
  }
  return internal::ShowsInResiduals(gain, left, kMinSignificance);
}

bool Matters(const CheckWork& work, const Change& change) {
  const double own = work.checks[static_cast<size_t>(change.camera)].own_rms_px / std::sqrt(2.0);
  return change.significance > kMinSignificance && change.shift_px > std::max(kMinShiftPx, own) &&
         ShowsInResiduals(work, change);
}

/// Poses after the cut anew, from its boards alone.
void SolveBothSides(const CheckWork& work, Change* change) {
  if (change->steady) return;
  RefineCut(work, change);
  const auto before = PoseBy(work, change->camera, change->before), after = PoseBy(work, change->camera, change->after);
  if (before) change->pose_before = before->cam_from_world;
  if (after) change->pose_after = after->cam_from_world;
}

std::vector<Change> ChangesThatMatter(CheckWork* work) {
  std::vector<Change> changes;
  for (size_t c = 0; c < work->checks.size(); ++c) {
    if (!work->present[c] || work->moved[c]) continue;
    internal::HearVoters(static_cast<int>(c), work);
    auto change = LargestChange(*work, static_cast<int>(c));
    if (change && Matters(*work, *change)) changes.push_back(std::move(*change));
  }
  std::sort(changes.begin(), changes.end(), [](const Change& a, const Change& b) { return a.gain > b.gain; });
  return changes;
}

CameraMotion Describe(const CheckWork& work, const std::vector<int64_t>& frames, const Change& change) {
  CameraMotion motion;
  if (change.steady) motion.kind = CameraMotion::Kind::kDrift;
  motion.cameras = {work.checks[static_cast<size_t>(change.camera)].name};
  motion.frame_idx = frames[static_cast<size_t>(FrameOf(work, change.after.front()))];
  motion.last_before = frames[static_cast<size_t>(FrameOf(work, change.before.back()))];
  const Vector6d step = Step(change.pose_before, change.pose_after);
  motion.rotation_rad = step.head<3>().norm();
  motion.rotation_sigma_rad = change.rotation_sigma_rad;
  motion.translation_m = step.tail<3>().norm();
  motion.shift_px = change.shift_px;
  motion.significance = change.significance;
  return motion;
}

CheckWork Prepare(const geometry::Rig& rig, const CalibrateInput& input) {
  CheckWork work = internal::PrepareCheck(rig, {}, input);
  work.present.assign(rig.cameras.size(), true);
  work.all_views_of_board = work.problem.views_of_board;
  work.state.world_from_board.resize(work.problem.views_of_board.size());
  return work;
}

/// Names of the cameras that explain nearly as much as the best one and nothing once that one is set aside.
std::vector<std::string> Rivals(const std::vector<Change>& changes, const std::vector<Change>& left, const CheckWork& work) {
  std::vector<std::string> names;
  for (size_t i = 1; i < changes.size(); ++i) {
    const bool remains =
        std::any_of(left.begin(), left.end(), [&](const Change& change) { return change.camera == changes[i].camera; });
    if (changes[i].gain >= kTie * changes[0].gain && !remains)
      names.push_back(work.checks[static_cast<size_t>(changes[i].camera)].name);
  }
  return names;
}

}  // namespace

std::vector<CameraMotion> FindMotions(const geometry::Rig& rig, const CalibrateInput& input) {
  std::vector<CameraMotion> motions;
  std::vector<int64_t> frames;
  MakeViews(input.boards, input.detections, &frames);
  CheckWork work = Prepare(rig, input);
  internal::HearVoters(-1, &work);
  PlaceBoards(&work);
  std::vector<Change> changes = ChangesThatMatter(&work);
  while (!changes.empty()) {
    internal::HearVoters(changes[0].camera, &work);
    SolveBothSides(work, &changes[0]);
    motions.push_back(Describe(work, frames, changes[0]));
    work.moved[static_cast<size_t>(changes[0].camera)] = true;
    internal::HearVoters(-1, &work);
    PlaceBoards(&work);
    const std::vector<Change> left = ChangesThatMatter(&work);
    for (const std::string& name : Rivals(changes, left, work)) motions.back().cameras.push_back(name);
    changes = left;
  }
  return motions;
}

}  // namespace mvstudio::calib
