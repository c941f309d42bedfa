#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "calib/check/check_steps.h"
#include "core/statistics.h"

/// What a check says about residuals.
namespace mvstudio::calib::internal {
namespace {

using geometry::Rigid3;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double RmsOfUsed(const Eigen::VectorXd& distances, const View& view) {
  const auto used = (view.weights.array() > 0).cast<double>();
  return std::sqrt((used > 0).select(distances.array().square(), 0).sum() / used.sum());
}

/// Views of a camera that are not far worse than its others, as calibrated.
std::vector<size_t> OrdinaryViews(const CheckWork& work, size_t camera, CameraCheck* check) {
  std::vector<size_t> views, ordinary;
  std::vector<double> rms;
  for (size_t v = 0; v < work.problem.views.size(); ++v) {
    const View& view = work.problem.views[v];
    if (view.camera_idx != static_cast<int>(camera)) continue;
    const Rigid3& board = work.state.world_from_board[static_cast<size_t>(work.problem.board_of_view[v])];
    views.push_back(v);
    rms.push_back(
        RmsOfUsed(CornerDistances(view, work.problem.cameras[camera], work.rig.cameras[camera].cam_from_world * board), view));
  }
  const double limit = 4 * UpperMedian(rms);
  for (size_t i = 0; i < views.size(); ++i) {
    if (!(rms[i] > limit)) ordinary.push_back(views[i]);
  }
  check->num_outlying_views = static_cast<int>(views.size() - ordinary.size());
  return ordinary;
}

/// Robust cost per corner of all views, boards where all cameras with these poses put them.
double CostWith(const std::vector<Rigid3>& cam_from_world, CheckWork* work) {
  work->problem.views_of_board = work->all_views_of_board;
  PoseState state = work->state;
  state.cam_from_world = cam_from_world;
  double cost = 0, corners = 0;
  for (size_t b = 0; b < work->all_views_of_board.size(); ++b) {
    const int board = static_cast<int>(b);
    SolveBoards(work->problem, {board}, &state);
    cost += BoardsCost(work->problem, state, {board});
    for (const int v : work->all_views_of_board[b])
      corners += static_cast<double>((work->problem.views[static_cast<size_t>(v)].weights.array() > 0).count());
  }
  return cost / std::max(1.0, corners);
}

std::vector<Rigid3> PosesOf(const geometry::Rig& rig) {
  std::vector<Rigid3> poses;
  for (const geometry::RigCamera& camera : rig.cameras) poses.push_back(camera.cam_from_world);
  return poses;
}

}  // namespace

void KeepIfBetter(const geometry::Rig& rig, CheckWork* work, RigCheck* result) {
  std::vector<Rigid3> poses = PosesOf(rig);
  result->cost = CostWith(poses, work);
  if (result->moved.empty()) return;
  for (size_t c = 0; c < poses.size(); ++c) {
    if (work->moved[c]) poses[c] = work->checks[c].cam_from_world;
  }
  if (CostWith(poses, work) < result->cost) return;
  result->moved.clear();
  work->moved.assign(work->moved.size(), false);
}

bool ShowsInResiduals(double gain, double left, double sigmas) {
  constexpr double kParams = 6, kOfExpected = 0.5, kVisible = 0.02;
  return gain > kOfExpected * kParams * sigmas * sigmas && gain > kVisible * left;
}

double OwnCost(const PoseProblem& problem, const PoseState& state, int camera, int board) {
  double cost = 0;
  for (const int v : problem.views_of_board[static_cast<size_t>(board)]) {
    const View& view = problem.views[static_cast<size_t>(v)];
    if (view.camera_idx == camera)
      cost += RobustViewCost(ViewSquares(problem, state, v), (view.weights.array() > 0).count(), nullptr);
  }
  return cost;
}

double ShiftPx(const CheckWork& work, const PoseState& state, int camera, const Rigid3& a, const Rigid3& b) {
  const geometry::Projector projector(work.problem.cameras[static_cast<size_t>(camera)]);
  double sum = 0;
  int count = 0;
  for (size_t v = 0; v < work.problem.views.size(); ++v) {
    const View& view = work.problem.views[v];
    if (view.camera_idx != camera) continue;
    const Rigid3& board = state.world_from_board[static_cast<size_t>(work.problem.board_of_view[v])];
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      const Eigen::Vector3d x = board * Eigen::Vector3d(view.x_in_board.col(i));
      const geometry::Projection pa = projector.Project(a * x), pb = projector.Project(b * x);
      if (pa.status != Status::kOk || pb.status != Status::kOk) continue;
      sum += (pa.px - pb.px).squaredNorm();
      ++count;
    }
  }
  return count > 0 ? std::sqrt(sum / count) : std::numeric_limits<double>::infinity();
}

void FillResiduals(const CheckWork& work, RigCheck* result) {
  std::vector<double> all;
  double all_squares = 0;
  for (size_t c = 0; c < work.checks.size(); ++c) {
    CameraCheck check = work.checks[c];
    std::vector<double> distances;
    double squares = 0, squares_after = 0;
    for (const size_t v : OrdinaryViews(work, c, &check)) {
      const View& view = work.problem.views[v];
      const Rigid3& board = work.state.world_from_board[static_cast<size_t>(work.problem.board_of_view[v])];
      const Eigen::VectorXd before = CornerDistances(view, work.problem.cameras[c], work.rig.cameras[c].cam_from_world * board);
      const Eigen::VectorXd after = CornerDistances(view, work.problem.cameras[c], check.cam_from_world * board);
      for (Eigen::Index i = 0; i < view.size(); ++i) {
        if (view.weights[i] <= 0) continue;
        distances.push_back(before[i]);
        squares += before[i] * before[i], squares_after += after[i] * after[i];
      }
    }
    const double count = static_cast<double>(distances.size());
    check.rms_px = count > 0 ? std::sqrt(squares / count) : kNaN;
    check.rms_after_px = count > 0 ? std::sqrt(squares_after / count) : kNaN;
    check.median_px = UpperMedian(distances);
    check.moved = work.moved[c];
    if (!work.moved[c]) all.insert(all.end(), distances.begin(), distances.end()), all_squares += squares;
    if (work.present[c]) result->cameras.push_back(check);
  }
  result->rms_px = all.empty() ? kNaN : std::sqrt(all_squares / static_cast<double>(all.size()));
  result->median_px = UpperMedian(all);
}

}  // namespace mvstudio::calib::internal
