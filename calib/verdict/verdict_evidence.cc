#include <algorithm>
#include <cmath>

#include "calib/verdict/judgement.h"
#include "core/format.h"
#include "core/join.h"
#include "core/text/shell_word.h"
#include "core/units.h"

namespace mvstudio::calib::internal {
namespace {

constexpr double kWarnRejected = 0.10, kFailRejected = 0.40;  // of a camera's corners
constexpr double kWarnLost = 0.05;                            // of its boards
constexpr double kFailRatio = 6, kFailExcessPx = 2;           // of a contradiction
constexpr double kFailMotionPx = 1;
constexpr double kFailHeldRatio = 3, kFailHeldPx = 0.5;  // of a held lens against the corners' noise
constexpr double kMinReadoutSigmas = 5, kWarnReadoutPx = 0.3, kFailReadoutPx = 3;
// Held-out corners beyond 5 px: as for a camera by itself.
constexpr double kWarnGross = 0.005, kFailGross = 0.05;

/// One camera contradicts itself alone: its lens, its board, its images.
const char* HintFor(bool in_rig) {
  return in_rig ? kTimeHint
                : "look at these images: blur, a hand over the board, corners numbered otherwise, a board that bends";
}

std::string Between(const CameraMotion& motion) {
  return Format("between frames %lld and %lld", static_cast<long long>(motion.last_before),
                static_cast<long long>(motion.frame_idx));
}

void JudgeLensChange(const CameraMotion& motion, const std::string& names, double scale, Judgement* out) {
  const std::string text = Format(
      "the lens of camera %s changed %s: focal length times %.5g +- %.1g, principal point moved by %.1f, %.1f px "
      "(%.1f px in its image)",
      names.c_str(), Between(motion).c_str(), motion.focal_scale, motion.focal_scale_sigma, motion.centre_shift_px.x(),
      motion.centre_shift_px.y(), motion.shift_px);
  out->Limit(motion.shift_px, 0, kFailMotionPx * scale, "CAL-LENSCHANGED", text,
             "focus, zoom, stabiliser, crop or scale: fix them and film again, or treat it as two cameras with a lens each: "
             "option 'split-at' " +
                 ShellWord(motion.cameras[0] + ":" + std::to_string(motion.frame_idx) + ":lens"));
}

void JudgeDrift(const CameraMotion& motion, const std::string& names, double scale, Judgement* out) {
  out->Limit(
      motion.shift_px, 0, kFailMotionPx * scale, "CAL-MOVED",
      Format("camera %s moved steadily from frame %lld to frame %lld: turned by %.3g +- %.2g degrees, %.3g mm (%.1f px in its "
             "image)",
             names.c_str(), static_cast<long long>(motion.last_before), static_cast<long long>(motion.frame_idx),
             RadToDeg(motion.rotation_rad), RadToDeg(motion.rotation_sigma_rad), 1e3 * motion.translation_m, motion.shift_px),
      "its mount is loose, or its clock runs at another rate: fasten it and film again");
}

void JudgeMotion(const CameraMotion& motion, double scale, Judgement* out) {
  const std::string names = Join(motion.cameras, " or ");
  if (motion.kind == CameraMotion::Kind::kLens) return JudgeLensChange(motion, names, scale, out);
  if (motion.kind == CameraMotion::Kind::kDrift) return JudgeDrift(motion, names, scale, out);
  const std::string text = Format("camera %s moved %s: turned by %.3g +- %.2g degrees, %.3g mm (%.1f px in its image)",
                                  names.c_str(), Between(motion).c_str(), RadToDeg(motion.rotation_rad),
                                  RadToDeg(motion.rotation_sigma_rad), 1e3 * motion.translation_m, motion.shift_px);
  const std::string hint = motion.cameras.size() > 1
                               ? "two cameras only know of each other: film again, or leave out what came after frame " +
                                     std::to_string(motion.last_before)
                               : "treat it as two cameras, before and after: option 'split-at' " +
                                     ShellWord(names + ":" + std::to_string(motion.frame_idx));
  out->Limit(motion.shift_px, 0, kFailMotionPx * scale, "CAL-MOVED", text, hint);
}

void JudgeRejected(const CalibrateReport& report, int camera_idx, Judgement* out) {
  const CameraReport& camera = report.cameras[static_cast<size_t>(camera_idx)];
  const bool in_rig = report.cameras.size() > 1;
  const char* name = camera.name.c_str();
  const int all = camera.num_corners + camera.num_rejected;
  if (camera.num_corners == 0) {
    out->Fail("CAL-NOCORNERS",
              Format("camera %s: none of its %d corners agrees with the %s", name, all, in_rig ? "other cameras" : "solution"),
              HintFor(in_rig));
    return;
  }
  const double share = static_cast<double>(camera.num_rejected) / all - SlightlyRejected(report, camera_idx);
  out->Limit(share, kWarnRejected, kFailRejected, "CAL-REJECTED",
             Format("camera %s: %.0f %% of its corners were rejected", name, 100 * share), HintFor(in_rig));
  const double lost = static_cast<double>(camera.num_lost_views) / std::max(1, camera.num_views + camera.num_lost_views);
  out->Limit(lost, kWarnLost, 2, "CAL-LOST",
             Format("camera %s: %d of %d boards were rejected as a whole", name, camera.num_lost_views,
                    camera.num_views + camera.num_lost_views),
             HintFor(in_rig));
}

void JudgeContradiction(const CameraReport& camera, double scale, Judgement* out) {
  const double excess = camera.rms_px - camera.alone_rms_px, ratio = camera.rms_px / camera.alone_rms_px;
  const std::string text = Format("camera %s: %.2f px in the rig against %.2f px by itself: it contradicts the other cameras",
                                  camera.name.c_str(), camera.rms_px, camera.alone_rms_px);
  if (ratio > kFailRatio && excess > kFailExcessPx * scale) return out->Fail("CAL-CONTRADICTS", text, kTimeHint);
  if (ratio > kContradictsRatio && excess > kContradictsPx * scale) out->Warn("CAL-CONTRADICTS", text, kTimeHint);
}

/// Clocks at different rates are no fault of the solution, which counts them, but of every other recording.
void JudgeClock(const CameraReport& camera, double span_frames, Judgement* out) {
  constexpr double kWorthTelling = 0.05;  // frames over the recording
  const double drift = camera.time_rate * span_frames;
  if (!(std::abs(drift) > kWorthTelling)) return;
  out->Warn(
      "CAL-CLOCK",
      Format("the clock of camera %s runs %s than the others': its frames last %.6g times as long, %.2f frames over the "
             "recording; the solution counts this",
             camera.name.c_str(), drift > 0 ? "slower" : "faster", 1 + camera.time_rate, std::abs(drift)),
      "drive all cameras from one clock, or record time stamps; for other recordings mvstudio sync finds offset and rate");
}

/// A camera that is late sees boards at places that are interpolated: said where these do not explain its images.
void JudgeLate(const CameraReport& camera, Judgement* out) {
  constexpr double kLate = 0.05, kWorse = 1.1, kSlackPx = 0.02, kShare = 0.01;
  const double all = camera.num_corners + camera.num_rejected;
  const bool explained = camera.rms_px <= kWorse * camera.alone_rms_px + kSlackPx && camera.num_lost_views == 0 &&
                         camera.num_rejected <= kShare * all;
  if (std::abs(camera.time_offset_frames) < kLate || explained) return;
  out->Warn(
      "CAL-LATE",
      Format("camera %s: its images are %.2f frames %s, and the boards' motion in between does not explain them (%.2f px in "
             "the rig against %.2f px by itself, %d corners rejected)",
             camera.name.c_str(), std::abs(camera.time_offset_frames), camera.time_offset_frames < 0 ? "early" : "late",
             camera.rms_px, camera.alone_rms_px, camera.num_rejected),
      "synchronise the cameras, or move the board slowly; clocks that drift and dropped frames look like this, too");
}

void JudgeReadout(const CameraReport& camera, double scale, Judgement* out) {
  constexpr double kLongest = 1.2;  // frames: a sensor's readout ends before the next image's begins
  const Readout& readout = camera.readout;
  if (std::abs(readout.frames) > kLongest) return;
  if (!(std::abs(readout.frames) > kMinReadoutSigmas * readout.sigma_frames)) return;
  out->Limit(readout.shift_px, kWarnReadoutPx * scale, kFailReadoutPx * scale, "CAL-ROLLING",
             Format("camera %s reads its rows one after the other, over %.2f +- %.2f of a frame: rolling shutter moves its "
                    "corners by %.2f px",
                    camera.name.c_str(), readout.frames, readout.sigma_frames, readout.shift_px),
             "hold the board still in every image that is used, or use a camera with a global shutter");
}

void JudgeAssumed(const CameraReport& camera, Judgement* out) {
  if (camera.assumes)
    out->Warn("CAL-ASSUMED", Format("camera %s: its boards do not determine its lens: ", camera.name.c_str()) + camera.given_up,
              "film more boards with it: tilted, near as well as far");
}

/// The boards' corners against a lens that they did not determine, and against no lens at all.
void JudgeHeldLens(const CameraReport& camera, double scale, bool in_rig, Judgement* out) {
  if (!camera.lens_held) return;
  const char* name = camera.name.c_str();
  const double excess = camera.rms_px - camera.smooth_rms_px, ratio = camera.rms_px / camera.smooth_rms_px;
  const std::string text = Format(
      "camera %s: with the held lens its corners are %.2f px off, and %.2f px without what varies smoothly over the boards",
      name, camera.rms_px, camera.smooth_rms_px);
  const char* const hint = "is it the lens of this camera at this setting, and the board as described?";
  if (ratio > kFailHeldRatio && excess > kFailHeldPx * scale) {
    out->Fail("CAL-HELD", text, hint);
  } else if (ratio > kContradictsRatio && excess > kContradictsPx * scale) {
    out->Warn("CAL-HELD", text, hint);
  }
  if (in_rig && camera.num_places < 2)
    out->Warn(
        "CAL-NOHOLDOUT",
        Format("camera %s: its lens was held and its pose comes from one place of a board: no other view confirms it", name),
        "show it the board in a second place, or check the rig with another recording (calib eval)");
}

void JudgeMissing(const CalibrateReport& report, Judgement* out) {
  size_t missing = 0;
  for (const CameraReport& camera : report.cameras) missing += !std::isfinite(camera.holdout_rms_px);
  const bool many = missing >= 2 && 2 * missing > report.cameras.size();
  for (const CameraReport& camera : report.cameras) {
    if (std::isfinite(camera.holdout_rms_px)) continue;
    const std::string text =
        Format("camera %s: no held-out error, %d board%s in %d place%s", camera.name.c_str(), camera.num_views,
               camera.num_views == 1 ? "" : "s", camera.num_places, camera.num_places == 1 ? "" : "s");
    const char* const hint = "show it the board in 6 places or more";
    many ? out->Fail("CAL-NOHOLDOUT", text, hint) : out->Warn("CAL-NOHOLDOUT", text, hint);
  }
}

void JudgeRigHoldout(const CalibrateReport& report, Judgement* out) {
  if (!(report.rig_holdout_gross_fraction > kWarnGross)) return;
  const auto worst =
      std::max_element(report.cameras.begin(), report.cameras.end(), [](const CameraReport& a, const CameraReport& b) {
        return (std::isfinite(a.rig_holdout_gross_fraction) ? a.rig_holdout_gross_fraction : -1) <
               (std::isfinite(b.rig_holdout_gross_fraction) ? b.rig_holdout_gross_fraction : -1);
      });
  out->Limit(report.rig_holdout_gross_fraction, kWarnGross, kFailGross, "CAL-RIGHOLDOUT",
             Format("frames held out: %.1f %% of the corners are off by more than 5 px, most in camera %s (%.0f %%)",
                    100 * report.rig_holdout_gross_fraction, worst->name.c_str(), 100 * worst->rig_holdout_gross_fraction),
             kTimeHint);
}

/// Corners just outside the border may be a detector's.
void JudgeSize(const CameraReport& camera, Judgement* out) {
  constexpr double kWarn = 0.01, kFail = 0.1;
  if (!(camera.outside_fraction > kWarn)) return;
  const std::string text = Format("camera %s: %.0f %% of its corners lie outside the image size that was given",
                                  camera.name.c_str(), 100 * camera.outside_fraction);
  const char* const hint = "give the size of the images that the corners were found in";
  camera.outside_fraction > kFail ? out->Fail("CAL-SIZE", text, hint) : out->Warn("CAL-SIZE", text, hint);
}

/// Corners of rigid boards show up to 0.1 % of the board's size, for what detectors do to them.
void JudgeBending(const CalibrateReport& report, Judgement* out) {
  constexpr double kRatio = 2, kSigmas = 6, kShare = 0.002;
  const BoardBending& bending = report.bending;
  if (!(bending.variance_ratio > kRatio && bending.sigmas > kSigmas && bending.rms_m > kShare * report.board_size_m)) return;
  out->Warn(
      "CAL-BENDING",
      Format("the board seems to bend otherwise from image to image, by %.2g mm (%.1f times the variance that noise explains)",
             1e3 * bending.rms_m, bending.variance_ratio),
      "use a rigid board; the uncertainties do not count this");
}

void JudgeUnit(const CalibrateReport& report, Judgement* out) {
  constexpr double kSmallest = 0.002, kLargest = 20;  // diagonals of boards that somebody prints, metres
  const double size = report.board_size_m;
  if (!(size > 0) || (size >= kSmallest && size <= kLargest)) return;
  out->Warn("CAL-UNIT", Format("the board is %.3g m in size", size), "check the unit of the board's squares: mm, cm or m");
}

}  // namespace

double PixelScale(const CalibrateReport& report, size_t camera) {
  if (camera >= report.rig.cameras.size()) return 1;
  const geometry::Camera& lens = report.rig.cameras[camera].camera;
  return std::max(1.0, std::hypot(lens.width_px, lens.height_px) / std::hypot(1920.0, 1080.0));
}

double SlightlyRejected(const CalibrateReport& report, int camera_idx) {
  constexpr double kSlightPx = 0.3;
  double slight = 0, all = 0;
  for (const CornerResidual& corner : report.residuals) {
    if (camera_idx >= 0 && corner.camera_idx != camera_idx) continue;
    all += 1, slight += corner.rejected && corner.residual_px.norm() < kSlightPx;
  }
  return slight / std::max(1.0, all);
}

void JudgeEvidence(const CalibrateReport& report, Judgement* out) {
  double largest = 1;
  const auto [first, last] = std::minmax_element(report.frames.begin(), report.frames.end());
  const double span = report.frames.empty() ? 0 : static_cast<double>(*last - *first);
  for (size_t c = 0; c < report.cameras.size(); ++c) {
    const CameraReport& camera = report.cameras[c];
    const double scale = PixelScale(report, c);
    largest = std::max(largest, scale);
    JudgeRejected(report, static_cast<int>(c), out);
    if (report.cameras.size() > 1) JudgeContradiction(camera, scale, out);
    JudgeLate(camera, out);
    JudgeClock(camera, span, out);
    JudgeReadout(camera, scale, out);
    JudgeSize(camera, out);
    JudgeAssumed(camera, out);
    JudgeHeldLens(camera, scale, report.cameras.size() > 1, out);
  }
  if (!report.boards_moved.empty())
    out->Warn("CAL-BOARDS", report.boards_moved,
              "fix the boards to each other and film again, or state with option 'free-boards' on that they move");
  for (const RotatedCamera& camera : report.rotated)
    out->Warn("CAL-NUMBERING", NumberingText(camera),
              "use a board with an odd and an even number of corners, or one with markers");
  for (const NumberingFault& fault : report.numbering)
    out->Fail("CAL-NUMBERING", ToString(fault),
              "number the board's corners alike in all cameras; boards that look the same after half a turn "
              "(even by even, odd by odd) invite it");
  if (report.layout) out->Fail("CAL-BOARD", ToString(*report.layout), "correct the board's columns and rows");
  JudgeUnit(report, out);
  JudgeBending(report, out);
  for (const CameraMotion& motion : report.motions) JudgeMotion(motion, largest, out);
  if (!report.unexplained.empty())
    out->Limit(
        report.unexplained_px, 0, kFailMotionPx * largest, "CAL-UNEXPLAINED", report.unexplained,
        "look at the boards with the largest residuals: images of another recording, corners numbered otherwise, a board "
        "that bends, cameras that start and stop");
  JudgeMissing(report, out);
  JudgeAspect(report, out);
  JudgeRigHoldout(report, out);
  JudgeLengths(report, largest, out);
}

}  // namespace mvstudio::calib::internal
