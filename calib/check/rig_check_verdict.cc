#include <cmath>

#include "calib/check/check_steps.h"
#include "core/format.h"
#include "core/units.h"

namespace mvstudio::calib::internal {
namespace {

constexpr int kFewViews = 5;

std::string Motion(const CameraCheck& c) {
  return Format("%.3f +- %.3f deg, %.2f +- %.2f mm (%.2f px in its image)", RadToDeg(c.rotation_rad),
                RadToDeg(c.rotation_sigma_rad), 1e3 * c.translation_m, 1e3 * c.translation_sigma_m, c.shift_px);
}

/// A camera that shares no board. Where it is the only one, nothing else could be checked.
void JudgeLensAlone(const CameraCheck& c, const RigCheckOptions& options, const RigCheck& check, Verdict* verdict) {
  const char* name = c.name.c_str();
  const bool has_lens = c.lens && c.lens->status == Status::kOk;
  if (check.cameras.size() > 1) {
    verdict->Warn({"CAL-FEWVIEWS",
                   Format("camera %s shares no board with another camera: ", name) +
                       (has_lens ? "only its lens is checked" : "it is not checked"),
                   "hold the board where another camera sees it too"});
  }
  if (!has_lens) return;
  const LensCheck& lens = *c.lens;
  if (!lens.changed && lens.rms_px <= options.warn_px) return;
  const std::string figures =
      Format("%.2f px with every board placed for it, %.2f px with its numbers fitted anew", lens.rms_px, lens.refitted_rms_px);
  const std::string change =
      Format(": focal length %.1f -> %.1f px, points move by %.1f px", lens.focal_px, lens.refitted_focal_px, lens.shift_px);
  const bool fails = lens.changed ? lens.shift_px > options.fail_px : lens.rms_px > options.fail_px;
  verdict->Add(
      fails, {"CAL-LENS", Format("camera %s: ", name) + (lens.changed ? "its lens has changed: " + figures + change : figures),
              "its zoom or focus may have changed, or the board is not the one that was named"});
}

void JudgeCamera(const CameraCheck& c, const RigCheckOptions& options, const RigCheck& check, Verdict* verdict) {
  const char* name = c.name.c_str();
  if (c.num_views == 0) {
    JudgeLensAlone(c, options, check, verdict);
    return;
  }
  if (c.moved) {
    verdict->Fail({"CAL-BUMPED", Format("camera %s has moved: ", name) + Motion(c),
                   "calibrate anew, or take the new pose with option 'repair'"});
    return;
  }
  if (c.num_views < kFewViews) {
    verdict->Warn({"CAL-FEWVIEWS", Format("camera %s: only %d boards are shared with another camera", name, c.num_views),
                   Format("%d or more are better", kFewViews)});
  }
  if (c.num_outlying_views > 0) {
    verdict->Warn(
        {"CAL-FRAMES",
         Format("camera %s: %d of %d boards disagree grossly with the other cameras", name, c.num_outlying_views, c.num_views),
         "check the synchronisation, or give the frames' times as option 'timestamps'; hold the board still"});
  }
  if (c.own_rms_px > options.warn_px) {
    verdict->Add(c.own_rms_px > options.fail_px,
                 {"CAL-LENS", Format("camera %s: %.2f px even with every board placed for it alone", name, c.own_rms_px),
                  "its zoom or focus may have changed, or the board is not the one that was named"});
  }
  if (c.rms_px > options.warn_px && check.undecided.empty()) {
    verdict->Add(c.rms_px > options.fail_px,
                 {"CAL-RESIDUAL",
                  Format("camera %s: %.2f px against the boards that all cameras agree on (limit %.1f)", name, c.rms_px,
                         c.rms_px > options.fail_px ? options.fail_px : options.warn_px),
                  "check that the footage is synchronised and the board is the one that was named"});
  }
}

/// What was found about the corners and put right.
void JudgeFound(const RigCheck& check, Verdict* verdict) {
  if (!check.exchanged.empty())
    verdict->Fail(
        {"CAL-EXCHANGED",
         Format(
             "the corners of cameras %s and %s are each other's: with their names exchanged %.2f px rms remain, and no camera "
             "has moved",
             check.exchanged[0].c_str(), check.exchanged[1].c_str(), check.rms_px),
         "exchange the two names in the footage, or in the calibration by calib convert, option 'rename'"});
  for (const RotatedCamera& camera : check.found.rotated)
    verdict->Warn(
        {"CAL-NUMBERING", NumberingText(camera), "use a board with an odd and an even number of corners, or one with markers"});
  if (!check.found.numbers_text.empty())
    verdict->Warn({"CAL-FRAMES", check.found.numbers_text,
                   "number the frames by their time stamps, or give them as option 'timestamps'"});
  for (const LateCamera& camera : check.late)
    verdict->Warn(
        {"CAL-LATE",
         Format("camera %s takes its images %.2f frames %s than the others, which the calibration does not state; with that, "
                "no camera has moved",
                camera.camera.c_str(), std::abs(camera.frames), camera.frames > 0 ? "later" : "earlier"),
         "synchronise the cameras, or calibrate this recording anew: offsets are lost where a calibration is written in a "
         "format "
         "without them, and change when cameras are started anew"});
  if (check.offsets_stated && !check.offsets_used)
    verdict->Warn({"CAL-LATE",
                   "the time offsets that the calibration states are not applied: the corners agree better without them",
                   "the cameras were started anew since, or their clocks run apart"});
}

/// Lengths that are wrong by ten times the limit are another board's; of two cameras, a baseline that is off looks the same.
void JudgeScale(const RigCheckOptions& options, const RigCheck& check, Verdict* verdict) {
  constexpr double kFails = 10;
  const double percent = 100 * (check.scale - 1);
  if (!(std::abs(percent) > options.scale_percent)) return;
  const std::string either = "; or the two cameras stand that much farther apart or closer than when they were calibrated";
  const bool alone = check.two_cameras && check.undecided.empty();
  verdict->Add(
      alone || std::abs(percent) > kFails * options.scale_percent,
      {"CAL-SCALE",
       Format("lengths by this calibration differ from those on the board by %+.2f %%", percent) + (alone ? either : ""),
       "check the size of the board's squares, now and at the calibration"});
}

}  // namespace

void JudgeCheck(const RigCheckOptions& options, RigCheck* check) {
  Verdict& verdict = check->verdict;
  if (check->status != Status::kOk) {
    verdict.Fail({"CAL-UNSOLVED", check->message, "show the board to at least two cameras at a time"});
    return;
  }
  JudgeFound(*check, &verdict);
  if (!check->undecided.empty()) {
    std::string names, motions;
    for (const CameraCheck& c : check->cameras) {
      for (const std::string& name : check->undecided) {
        if (c.name != name) continue;
        names += (names.empty() ? "" : ", ") + name;
        motions += (motions.empty() ? "" : "; ") + name + " " + Motion(c);
      }
    }
    verdict.Fail({"CAL-BUMPED", "one of the cameras " + names + " has moved; it cannot be told which. If it was: " + motions,
                  check->cameras.size() < 3 ? "two cameras only know of each other: a third one decides"
                                            : "hold the board where three of them see it at a time"});
  }
  JudgeScale(options, *check, &verdict);
  for (const CameraCheck& c : check->cameras) JudgeCamera(c, options, *check, &verdict);
}

}  // namespace mvstudio::calib::internal
