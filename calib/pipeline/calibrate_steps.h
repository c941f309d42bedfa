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

/// The steps of Calibrate and their shared state. Included by the .cc files of Calibrate only.
namespace mvstudio::calib::internal {

/// CalibrateOptions::world among the cameras there are.
struct World {
  bool is_board = false;
  int camera = 0;
  int64_t frame_idx = 0;
};

struct Work {
  std::vector<View> views;                       // of the frames that take part
  std::vector<View> held_out;                    // of the others
  std::vector<int64_t> frames;                   // of both
  std::vector<MonoSolution> monos;               // per camera
  std::vector<std::vector<int>> view_ids;        // per camera: indices into views, in the order of its mono solution
  std::vector<geometry::Rigid3> cam_from_board;  // per view, from that view alone
  std::vector<Eigen::VectorXd> prior;            // per view: initial weights, before any rejection
  std::vector<bool> placed;                      // per view: its board has a place in the rig
  std::vector<std::optional<geometry::Rigid3>> known_poses;  // per camera
  RigState state;
  bool free_boards = false;  // each board has its own place in every time step; frames count (board, time step)
  bool may_separate = true, separated = false;  // lenses that were shared, see SeparateLenses
  std::vector<LensStep> lens_step;              // per camera
  std::vector<std::string> alone_failed;  // per camera: why it has no solution alone without assumptions; empty: it has one
  BundleOptions bundle;                   // of the last adjustment
  std::vector<View> evidence;             // views with the weights of the covariance: repeats discounted
  FrameOffsets offsets;                   // from the cameras' separate solutions
  std::vector<int64_t> shift;             // per camera: correction of its frame numbers; the run must be repeated with it
};

void Stop(Status status, const std::string& message, CalibrateReport* report);

/// Frames of different cameras that do not belong together are refused, or shifted unless `time_offset` is none.
bool CheckFrames(const CalibrateOptions& options, const BoardTurns& turns, Work* work, CalibrateReport* report);
/// Frames of a camera count otherwise, or some were lost: the run must be repeated with other numbers.
bool OtherNumbers(const CalibrateReport& report);
CalibrateInput WithNumbers(CalibrateInput input, const CalibrateReport& found);
/// Whether the solution with other numbers leaves what it must be weighed against.
bool DoubtfulNumbers(const CalibrateReport& found, const CalibrateReport& again);
/// Whether other numbers are a cause beside others. A clock that drifts looks like single frames that were lost, one after the
/// other.
bool NumbersPay(const CalibrateReport& found, const CalibrateReport& again, const CalibrateReport& plain);
/// What was done to the numbers; times of motions as the camera's own frames have them.
void StateNumbers(const CalibrateReport& found, CalibrateReport* again);
void StateShift(const std::vector<int64_t>& shift, const std::string& message, CalibrateReport* again);
/// A conflict of two cameras by themselves stands unless the rig explains their boards about as well as each does alone.
void ReconsiderFrames(const Work& work, CalibrateReport* report);

World FindWorld(const WorldOrigin& origin, const std::vector<CameraInput>& cameras);

/// Throws UsageError or ContractViolation for cameras without a size or with equal names, and for detections of unknown
/// cameras or given twice.
void CheckInput(const CalibrateInput& input);

/// NAME@FRAME.
std::string LaterName(const CameraSplit& split);
/// The camera's later frames become those of another camera.
void SplitCamera(const CameraSplit& split, CalibrateInput* input);

/// Camera indices sorted by name, so that the result does not depend on the input order.
std::vector<int> ByName(const CalibrateInput& input);
CalibrateInput Permuted(const CalibrateInput& input, const std::vector<int>& order);
void RestoreOrder(const std::vector<int>& order, CalibrateReport* report);

/// Makes the views of the used frames and of those that are held out.
void MakeWork(const CalibrateInput& input, const CalibrateOptions& options, Work* work);

/// Turns views that number a chessboard or a grid from the other end than the others of their frame, held-out ones too, and
/// their corners in the input, which later steps read.
void TurnNumbering(CalibrateInput* input, Work* work, CalibrateReport* report);

/// Whether held poses are in the unit of the boards, as far as these say: false, with a status in the report, where cameras are
/// three times as far apart or more, or a third or less, all pairs alike.
bool CheckUnitOfHeldPoses(const Work& work, CalibrateReport* report);

/// Lenses alone: one frame a view.
void SeparateViews(Work* work);

/// Moves the solution so that the board of the wanted frame defines the world.
bool UseBoardWorld(const CalibrateInput& input, const World& world, Work* work, CalibrateReport* report);

/// The cameras whose lenses, or poses, are held: one flag per camera.
std::vector<bool> HeldCameras(const std::vector<HeldPart>& fix, HeldPart::What what, const std::vector<CameraInput>& cameras);

/// Calibrates cameras separately and chooses lens models, sharing and warp by held-out error. Fills state.cameras,
/// lens_group, board_warp_m, cam_from_board and the lens part of the report. False when there is no solution.
bool CalibrateLenses(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run, Work* work,
                     CalibrateReport* report);

/// Solves one camera alone under a lens, without an initial guess.
MonoSolution SolveUnder(const CameraInput& camera, const LensStep& step, const std::vector<View>& views,
                        const BundleOptions& options);

/// Standard deviation of a corner of weight 1 in a camera's separate solution; a typical value where it has none.
double SigmaOf(const MonoSolution& mono);

/// Why the boards do not determine a camera's focal length; empty where they do. Undetermined is one known to less than a
/// quarter, and one that had to be assumed and that the boards draw far beyond what was assumed.
std::string WhyFocalLengthIsOpen(const Work& work, const CameraReport& camera, size_t camera_idx);

/// Whether the camera's lens model may be changed.
bool MaySimplify(const CalibrateInput& input, const CalibrateOptions& options, const Work& work, int camera);

/// Replaces the lenses of `cameras` (and of those that share them) by the next simpler one that has a solution; `why` is
/// stored in the report. False when no such lens exists for any of them.
bool SimplifyLenses(const CalibrateInput& input, const CalibrateOptions& options, const std::vector<int>& cameras,
                    const std::string& why, Work* work, CalibrateReport* report);

/// Tests separate lenses for cameras that share one because their own boards do not distinguish them. The rig's corners
/// may, above all for long focal lengths. Returns the adjustment with a lens each, in `work`, where it pays. Empty where
/// it does not, or where sharing was requested.
std::optional<BundleReport> SeparateLenses(const CalibrateInput& input, const CalibrateOptions& options, Work* work,
                                           CalibrateReport* report);

/// Whether boards that are taken as rigid to each other may be why `rigid` failed or is contradictory (option `free_boards`
/// auto).
bool DoubtfulBoards(const CalibrateInput& input, const CalibrateOptions& options, const CalibrateReport& rigid);

/// Whether boards that each have a pose of their own in every time step explain what rigid ones do not: by far fewer and
/// smaller errors. CalibrateReport::boards_moved then says so.
bool FreeBoardsPay(const CalibrateReport& rigid, CalibrateReport* free);

/// One lens for several cameras stays although the corners contradict it, since those of their own have no solution.
void AssumeSharing(const std::string& why, CalibrateReport* report);

/// Gives every camera its own lens from here on; the report states why.
void GiveLensesOfTheirOwn(Work* work, CalibrateReport* report);

/// Finds cameras that moved and lenses that changed (CalibrateOptions::motions); stores them in `solved`. `input` with what was
/// found about it: views turned, frame numbers shifted.
void LookForMotions(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run,
                    CalibrateReport* solved);

/// The cameras outside the largest of these groups where it holds more than half of all; empty where it does not.
std::vector<int> CamerasBesideMost(const std::vector<std::vector<int>>& groups);

/// Cameras whose lenses have the most parameters.
std::vector<int> MostDemanding(const Work& work);

/// What is estimated of the cameras' clocks.
struct TimeModel {
  bool offsets = false, rates = false;
  MotionModel motion;
};

/// By the option `time_offset`. With auto by the residuals, then by held-out frames, from a solution without offsets whose
/// standard deviation per coordinate is `sigma_px`.
TimeModel ChooseTimeModel(const CalibrateOptions& options, const Work& work, double sigma_px, std::string* reason);

/// The adjustment with time offsets, started at the solution without them; restores the initial weights of rejected
/// corners.
BundleReport SolveWithTimeOffsets(const TimeModel& time, Work* work);

/// Stores covariances and time offsets in the rig. Unknown are the covariances of a camera without corners and of what
/// `fix` holds at a calibration that states none; the frame itself is exact.
void StoreCalibrationCovariance(const RigCovariance& covariance, const HeldCovariance& held, const Work& work,
                                geometry::Rig* rig);

/// A corner of a held-out frame.
struct RigError {
  int camera_idx = 0;
  double px = 0;  // infinite where the board could not be placed
};

/// Reprojection errors of held-out frames: each board's pose from half of the corners of all cameras, the error on the
/// others. `views` are those frames' views; lenses and camera poses are those of `state`.
std::vector<RigError> RigErrors(const std::vector<View>& views, const RigState& state);

/// How well each camera's fx / fy is known when the cells of the boards need not be square (CameraReport::aspect_sigma), where
/// pixels or cells seem not to be.
void ReportAspect(const std::vector<Board>& boards, const HeldCovariance& held, const Work& work, CalibrateReport* report);

/// There is no solution: what is known besides may be why.
void AddLikelyCauses(const CalibrateInput& input, CalibrateReport* report);

/// Fills all figures of the report that derive from the solution.
void FillReport(const CalibrateInput& input, const Work& work, const geometry::RigGauge& gauge, CalibrateReport* report);

}  // namespace mvstudio::calib::internal
