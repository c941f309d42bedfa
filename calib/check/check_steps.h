// Private: the state and the steps of CheckRig.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "calib/check/pose_problem.h"
#include "calib/check/rig_check.h"
#include "geometry/rig/rig_covariance.h"

namespace mvstudio::calib::internal {

/// State of one check.
struct CheckWork {
  const geometry::Rig& rig;
  RigCheckOptions options;
  PoseProblem problem;
  PoseState state;
  std::vector<std::vector<int>> all_views_of_board;  // problem.views_of_board with every camera's
  std::vector<geometry::Rigid3> own_pose;            // per view: cam_from_board
  std::vector<std::vector<int>> boards_of;           // per camera, those that it shares
  std::vector<std::vector<View>> views_alone;        // per camera, of boards that it shares with none
  std::vector<CameraCheck> checks;                   // per camera of the rig
  std::vector<bool> present, moved;
};

/// Fits every view by itself, drops corners and views that do not fit, and estimates each camera's noise. Keeps the views
/// of boards that two cameras share at one time step, with weights in px^-2. No camera is `present` yet.
CheckWork PrepareCheck(const geometry::Rig& rig, const RigCheckOptions& options, const CalibrateInput& input);

/// Boards are placed only by the cameras that have not moved, and by `camera` (-1: none): a freed camera does not influence
/// the others.
void HearVoters(int camera, CheckWork* work);

/// The input with the names of two of its cameras exchanged.
CalibrateInput WithExchanged(CalibrateInput input, size_t a, size_t b);
/// The two cameras of the input, of equal size, whose exchanged names leave the least cost, half of that of `check` or less.
/// Not tried for more than 12 cameras. `cost_of` places the boards anew.
std::optional<std::pair<size_t, size_t>> FindExchanged(const CalibrateInput& seen, const RigCheck& check,
                                                       const std::function<double(const CalibrateInput&)>& cost_of);

/// Checks the lenses of cameras that share no board: all that can be said of them.
void CheckLensesAlone(CheckWork* work);
/// The corners are of one camera, and its lens could be checked.
bool IsOneLens(const CheckWork& work);

/// Enters a camera's new pose, which SolveCamera found at `state` from `boards`, into the rig's stated covariance. `own`
/// is its covariance for an exact calibration. Added is the part that comes from its own lens and from the lenses and
/// poses of the cameras that placed the boards, with the correlation. Unknown covariances add nothing. For two repaired
/// cameras, the noise of the boards that placed them counts as independent.
void CarryIntoRepair(const CheckWork& work, const PoseState& state, const std::vector<int>& boards, int camera,
                     const Matrix6d& own, geometry::StatedCovariance* stated);

/// Whether a change of 6 parameters is visible in residuals that are as they are: `gain` of the robust cost (pose_problem.h)
/// above half of what a change of `sigmas` standard deviations gains, and above 2 % of `left`, the cost of the camera's own
/// views with the change. Whatever the poses say, nothing has moved while the rig explains its corners as well as noise allows.
bool ShowsInResiduals(double gain, double left, double sigmas);

/// Robust cost of the camera's views of one board.
double OwnCost(const PoseProblem& problem, const PoseState& state, int camera, int board);

/// Every camera's residuals against the boards of those that stayed, as calibrated and with its new pose.
void FillResiduals(const CheckWork& work, RigCheck* result);

/// Distances of the corners from their projections, px; infinity for those that do not project.
Eigen::VectorXd CornerDistances(const View& view, const geometry::Camera& camera, const geometry::Rigid3& cam_from_board);

/// RMS distance between the corners' pixels with two poses of the camera, boards where they are in `state`; NaN when no corner
/// is in front of both.
double ShiftPx(const CheckWork& work, const PoseState& state, int camera, const geometry::Rigid3& a, const geometry::Rigid3& b);

/// Lengths between corners that two or more cameras see, triangulated with the calibration unchanged, compared with the
/// board. `edge`: the shortest lengths on the board; `pair`: all of them.
BoardMetrics MeasureLengths(const std::vector<Board>& boards, const CheckWork& work);

/// Lengths by the calibration over lengths on the board. For each pair of cameras: the median over time steps of the scale
/// of the similarity that maps the board to its triangulated corners. Of the pairs, sorted by |scale - 1|, the one at a
/// third is taken, because a moved camera spoils at most two thirds of them. NaN when it cannot be measured.
double MeasureScale(const std::vector<Board>& boards, const CheckWork& work);

/// New poses that leave more of the corners unexplained than the old ones are not taken. Fills the cost of the calibration as
/// it is.
void KeepIfBetter(const geometry::Rig& rig, CheckWork* work, RigCheck* result);

/// Parts of a frame, per camera of the input, by which the cameras took their images later than they are numbered: what moves
/// their corners along their motion to where the boards that `place` (corners seen at such times) puts agree. The median camera
/// is on time, of two the first. Empty where no camera is late by 0.02 to 1 frames.
std::vector<geometry::TimeOffset> FindTimeOffsets(
    const CalibrateInput& seen, const std::function<CheckWork(const std::vector<geometry::TimeOffset>&)>& place);

/// Sets check->verdict from the other fields.
void JudgeCheck(const RigCheckOptions& options, RigCheck* check);

}  // namespace mvstudio::calib::internal
