#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/calibrate.h"
#include "calib/covariance/uncertainty.h"
#include "calib/lens/intrinsics.h"
#include "calib/lens/lens_pool.h"
#include "calib/lens/model_selection.h"
#include "calib/lens/simpler_lens.h"
#include "calib/rig/frame_offset.h"

/// The steps of Calibrate and what they hand on. Included by calibrate*.cc only.
namespace mvstudio::calib::internal {

/// `world`, parsed.
struct World {
  bool is_board = false;
  int camera = 0;
  int64_t frame_idx = 0;
};

struct Work {
  std::vector<View> views;                // of the frames that take part
  std::vector<View> held_out;             // of the others
  std::vector<int64_t> frames;            // of both
  std::vector<MonoSolution> monos;        // per camera
  std::vector<std::vector<int>> view_ids; // per camera: indices into views, in the order of its mono solution
  std::vector<geometry::Rigid3> cam_from_board;  // per view, from that view alone
  std::vector<Eigen::VectorXd> prior;     // per view: weights before anything was rejected
  std::vector<std::optional<geometry::Rigid3>> known_poses;  // per camera
  RigState state;
  bool may_separate = true, separated = false;  // lenses that were shared, see SeparateLenses
  std::vector<LensStep> lens_step;        // per camera
  std::vector<std::string> alone_failed;  // per camera: why it has no solution by itself without assumptions; empty: it has
  BundleOptions bundle;                   // of the last adjustment
  std::vector<View> evidence;             // views as the covariance counts them: repeats discounted
  FrameOffsets offsets;                   // as the cameras by themselves say
  std::vector<int64_t> shift;             // per camera: what its frame numbers lack; the run has to start again with them
};

void Stop(Status status, const std::string& message, CalibrateReport* report);

World ParseWorld(const std::string& text, const std::vector<CameraInput>& cameras);

/// Cameras without a size or of one name, detections of no camera or given twice: UsageError or a broken contract.
void CheckInput(const CalibrateInput& input);

/// `split_at`: the camera's later frames become those of another camera.
void SplitCamera(const std::string& text, CalibrateInput* input);

/// The cameras in the order of their names, so that the order in which they are given does not touch a digit.
std::vector<int> ByName(const CalibrateInput& input);
CalibrateInput Permuted(const CalibrateInput& input, const std::vector<int>& order);
void RestoreOrder(const std::vector<int>& order, CalibrateReport* report);

/// Views of the frames that take part and of those that are held out.
void MakeWork(const CalibrateInput& input, const CalibrateOptions& options, Work* work);

/// Names after "lenses" or "poses" in `fix`: one truth value a camera.
std::vector<bool> ParseFix(const std::vector<std::string>& fix, const std::string& what, const std::vector<CameraInput>& cameras);

/// Cameras by themselves, lens models, sharing and bend by held-out error. Fills state.cameras, lens_group, board_warp_m,
/// cam_from_board and the lens part of the report. False when there is no solution.
bool CalibrateLenses(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run, Work* work,
                     CalibrateReport* report);

/// A camera by itself under a lens, from no guess.
MonoSolution SolveUnder(const CameraInput& camera, const LensStep& step, const std::vector<View>& views, const BundleOptions& options);

/// Standard deviation of a corner of weight 1 in a camera by itself; a usual one where it has no solution.
double SigmaOf(const MonoSolution& mono);

/// Is the camera's lens ours to choose?
bool MaySimplify(const CalibrateInput& input, const CalibrateOptions& options, const Work& work, int camera);

/// The lenses of `cameras` (and of those that share them) go to the next simpler one that has a solution; `why` is kept in the
/// report. False when none of them has any.
bool SimplifyLenses(const CalibrateInput& input, const CalibrateOptions& options, const std::vector<int>& cameras,
                    const std::string& why, Work* work, CalibrateReport* report);

/// Cameras were given one lens because their boards by themselves do not tell their lenses apart: the rig's corners may, of long lenses
/// above all. The adjustment with a lens for each where that pays, in `work`; nothing where it does not, or where sharing was asked for.
std::optional<BundleReport> SeparateLenses(const CalibrateInput& input, const CalibrateOptions& options, Work* work,
                                           CalibrateReport* report);

/// Every camera has a lens of its own from here on, and the report says why.
void GiveLensesOfTheirOwn(Work* work, CalibrateReport* report);

/// Cameras that moved and lenses that changed (CalibrateOptions::motions), into `solved`.
void LookForMotions(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run, CalibrateReport* solved);

/// Cameras whose lenses have most numbers.
std::vector<int> MostDemanding(const Work& work);

/// Are the cameras' offsets in time to be estimated? `time_offset`; with auto by the residuals, then by held-out frames, from a
/// solution without them whose standard deviation per coordinate is `sigma_px`.
bool TimeOffsetsPay(const CalibrateOptions& options, const Work& work, double sigma_px, std::string* reason);

/// The adjustment with time offsets, from the solution without them; corners that it rejected have their say again.
BundleReport SolveWithTimeOffsets(Work* work);

/// Gives the rig the covariances and the time offsets. Unknown are those of a camera without corners and of what `fix` holds at
/// a calibration that states none; the frame itself is exact.
void StoreCalibrationCovariance(const RigCovariance& covariance, const HeldCovariance& held, const Work& work, geometry::Rig* rig);

/// A corner of a held-out frame.
struct RigError {
  int camera_idx = 0;
  double px = 0;  // infinite where the board could not be placed
};

/// Reprojection errors of held-out frames: the pose of every board from half of the corners of all cameras, the error on the
/// others. `views` are those frames' views, lenses and cameras are those of `state`.
std::vector<RigError> RigErrors(const std::vector<View>& views, const RigState& state);

/// Everything that is counted from the solution.
void FillReport(const CalibrateInput& input, const Work& work, const std::string& gauge, CalibrateReport* report);

}  // namespace mvstudio::calib::internal
