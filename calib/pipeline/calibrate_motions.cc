#include <map>
#include <tuple>

#include "calib/check/camera_motion.h"
#include "calib/pipeline/calibrate_steps.h"
#include "calib/pipeline/motion_kind.h"
#include "calib/pipeline/motion_rival.h"
#include "calib/pipeline/split_trial.h"
#include "calib/verdict/judgement.h"
#include "core/format.h"
#include "core/join.h"

/// What moved or changed while the boards were filmed, once there is a solution.
namespace mvstudio::calib::internal {
namespace {

/// The camera that contradicts the others most, well below what the verdict counts: what it does is looked for, and counts only
/// where it explains most of this. Empty: none.
std::string MostContradictory(const CalibrateReport& report) {
  constexpr double kRatio = 1.2, kExcessPx = 0.05;
  double most = kRatio;
  std::string name;
  for (size_t c = 0; c < report.cameras.size(); ++c) {
    const CameraReport& camera = report.cameras[c];
    const double ratio = camera.rms_px / camera.alone_rms_px, excess = camera.rms_px - camera.alone_rms_px;
    if (ratio > most && excess > kExcessPx * PixelScale(report, c)) most = ratio, name = camera.name;
  }
  return name;
}

/// The rig with the lens that a camera has by itself: the rig's may have taken up part of a motion. Nothing where it has none.
std::optional<geometry::Rig> WithLensAlone(const CalibrateInput& input, const CalibrateReport& solved, CalibrateOptions options,
                                           const RunContext& run, const std::string& name) {
  const auto at = static_cast<size_t>(solved.rig.Find(name));
  if (solved.rig.cameras[at].camera.model == geometry::LensModel::kSplined) return std::nullopt;
  CalibrateInput alone = input;
  alone.start.reset();
  alone.same_lens.clear();
  alone.cameras = {input.cameras[at]};
  alone.detections.clear();
  for (Detection detection : input.detections) {
    if (detection.camera_idx != static_cast<int>(at)) continue;
    detection.camera_idx = 0;
    alone.detections.push_back(std::move(detection));
  }
  options.model = solved.rig.cameras[at].camera.model;
  options.intrinsics_only = true;
  options.motions = false;
  options.share_intrinsics = {LensSharing::Kind::kNone, {}};
  options.time_offset = TimeOffsetChoice::kNone;
  options.world = {name, std::nullopt};
  options.fix.clear();
  options.split_at.clear();
  options.holdout = {};
  const CalibrateReport report = Calibrate(alone, options, run);
  if (report.status != Status::kOk) return std::nullopt;
  geometry::Rig rig = solved.rig;
  rig.cameras[at].camera = report.rig.cameras[0].camera;
  return rig;
}

/// Corners where they would be had all cameras taken their images at the times of the frames, as far as the solution knows.
CalibrateInput CornersAtFrames(CalibrateInput input, const CalibrateReport& solved) {
  std::map<std::tuple<int, int64_t, int, int>, Eigen::Vector2d> late_px;  // by camera, frame, board and corner
  for (const CornerResidual& corner : solved.residuals) {
    if (corner.late_px.allFinite() && !corner.late_px.isZero(0))
      late_px[{corner.camera_idx, corner.frame_idx, corner.board_idx, corner.corner_id}] = corner.late_px;
  }
  for (Detection& d : input.detections) {
    for (int i = 0; i < d.num_corners() && !late_px.empty(); ++i) {
      const auto found = late_px.find({d.camera_idx, d.frame_idx, d.board_idx, d.corner_ids[static_cast<size_t>(i)]});
      if (found != late_px.end()) d.points_px.col(i) -= found->second;
    }
  }
  return input;
}

/// Boards disagree between cameras when one of them moved: the frames are not in doubt where they agree before and after.
void ReconsiderFrames(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run,
                      CalibrateReport* solved) {
  if (solved->frames_conflict.empty() || solved->motions.size() != 1 || solved->motions[0].cameras.size() != 1) return;
  const CameraMotion& motion = solved->motions[0];
  if (motion.kind != CameraMotion::Kind::kMoved) return;
  const CalibrateReport parts = AdjustSplit(input, *solved, options, {motion.cameras[0], motion.frame_idx, false}, run);
  if (parts.status == Status::kOk && parts.frames_conflict.empty()) solved->frames_conflict.clear();
}

/// "camera a moved between frames 3 and 7".
std::string Said(const CameraMotion& motion) {
  const char* what = motion.kind == CameraMotion::Kind::kLens ? "the lens of camera %s changed" : "camera %s moved";
  return Format(what, Join(motion.cameras, " or ").c_str()) + Format(" between frames %lld and %lld",
                                                                     static_cast<long long>(motion.last_before),
                                                                     static_cast<long long>(motion.frame_idx));
}

/// The search for a change always finds the one that explains most. Where even that leaves most of what the cameras by
/// themselves do not have, it is not the cause, and what it advises would do harm.
void DropWhatDoesNotExplain(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run,
                            CalibrateReport* solved) {
  constexpr double kExplains = 0.5;  // of the squared errors beyond those of the cameras by themselves
  if (solved->motions.size() != 1 || solved->motions[0].kind == CameraMotion::Kind::kDrift) return;
  const CameraMotion& motion = solved->motions[0];
  const double now = CappedSquares(*solved, *solved, 0), noise = static_cast<double>(solved->residuals.size());
  double left = now, left_px = solved->rms_px;
  for (const std::string& name : motion.cameras) {
    const int camera = solved->rig.Find(name);
    if (camera < 0) continue;
    const bool lens = motion.kind == CameraMotion::Kind::kLens;
    const CalibrateReport split = AdjustSplit(input, *solved, options, {name, motion.frame_idx, lens}, run);
    const double squares = CappedSquares(split, *solved, static_cast<size_t>(camera));
    if (squares < left) left = squares, left_px = split.rms_px;
  }
  if (now - left > kExplains * (now - noise)) return;
  const char* none = solved->frames_conflict.empty() ? "none of the known causes" : "no change of a camera";
  solved->unexplained = Format("%s explains the residuals of %.2f px: ", none, solved->rms_px) + "best does that " +
                        Said(motion) + Format(", and it would leave %.2f px", left_px);
  if (!solved->time_reason.empty()) solved->unexplained += "; clocks: " + solved->time_reason;
  if (input.boards.size() > 1) solved->unexplained += "; boards that move against each other explain no more";
  solved->unexplained_px = motion.shift_px;
  solved->motions.clear();
}

}  // namespace

void LookForMotions(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run,
                    CalibrateReport* solved) {
  if (!options.motions || solved->status != Status::kOk || options.intrinsics_only || input.cameras.size() < 2) return;
  const CalibrateInput at_frames = CornersAtFrames(input, *solved);
  solved->motions = FindMotions(solved->rig, at_frames);
  const std::string name = solved->motions.empty() ? MostContradictory(*solved) : "";
  if (!name.empty()) {
    if (const auto rig = WithLensAlone(input, *solved, options, run, name)) solved->motions = FindMotions(*rig, at_frames);
  }
  if (solved->motions.size() == 1) NameCameraThatMoved(input, *solved, options, run, &solved->motions[0]);
  for (CameraMotion& motion : solved->motions) {
    if (motion.kind == CameraMotion::Kind::kMoved) ExplainMotion(input, *solved, options, run, &motion);
  }
  ReconsiderFrames(input, options, run, solved);
  if (solved->motions.empty()) {
    if (const auto change = FindLensChange(input, *solved, options, run, name)) solved->motions.push_back(*change);
  }
  DropWhatDoesNotExplain(input, options, run, solved);
}

}  // namespace mvstudio::calib::internal
