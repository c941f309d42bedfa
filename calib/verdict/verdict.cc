#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "calib/calibrate.h"
#include "calib/verdict/capture_advice.h"
#include "calib/verdict/judgement.h"
#include "core/format.h"
#include "core/statistics.h"
#include "geometry/rig/plausible.h"

namespace mvstudio::calib {
namespace {

using internal::Judgement;

constexpr double kWarnHoldoutPx = 1.0, kFailHoldoutPx = 3.0;
constexpr double kWarnHoldoutRatio = 1.5;
constexpr double kWarnRejected = 0.10, kFailRejected = 0.40;  // of all corners, those that the detector dropped among them
constexpr double kWarnFocalSigma = 0.01, kFailFocalSigma = 0.10;
constexpr double kWarnCoverage = 0.40;
constexpr int kWarnViews = 5;  // fewer leave no fold to hold out and judge the rest by
// Held-out corners beyond 5 px: one in 200 is a slip of the detector, one in 20 a lens or a board that is wrong.
constexpr double kWarnGross = 0.005, kFailGross = 0.05;
// Of triangulated points over the distance of the boards: 2 mm and 2 cm at 1 m.
constexpr double kWarnVolume = 0.002, kFailVolume = 0.02;

void JudgeError(const CameraReport& camera, double scale, bool in_rig, Judgement* out) {
  const char* name = camera.name.c_str();
  const double holdout = camera.holdout_rms_px, warn = kWarnHoldoutPx * scale, fail = kFailHoldoutPx * scale;
  if (holdout > fail) {
    out->Fail("CAL-HOLDOUT", Format("camera %s: held-out error %.2f px (limit %.1f)", name, holdout, fail),
              std::string("check the board's size and numbering, ") +
                  (in_rig ? "blur, and that the footage is synchronised" : "that it is flat, and blur"));
  } else if (holdout > warn) {
    out->Warn("CAL-HOLDOUT", Format("camera %s: held-out error %.2f px (good is below %.1f)", name, holdout, warn),
              "use sharper images and a flat board");
  }
  if (holdout > kWarnHoldoutRatio * camera.rms_px && holdout > 0.2) {
    out->Warn("CAL-HOLDOUT",
              Format("camera %s: held-out error %.2f px against %.2f px on its own boards", name, holdout, camera.rms_px),
              "film more boards, in more varied poses");
  }
}

void JudgeFocal(const CameraReport& camera, Judgement* out) {
  const double percent = 100 * camera.focal_sigma_px / camera.focal_px;
  const std::string text = Format("camera %s: the focal length is known to %.1f %% only", camera.name.c_str(), percent);
  const char* const hint = "show the board tilted, and near as well as far";
  if (percent > 100 * kFailFocalSigma) {
    out->Fail("CAL-FOCAL", text, hint);
  } else if (percent > 100 * kWarnFocalSigma) {
    out->Warn("CAL-FOCAL", text, hint);
  }
}

/// Boards that are nearly parallel to the image leave the principal point to noise; where it ends outside the image, few lenses
/// are so.
void JudgeCentre(const geometry::Camera& camera, Judgement* out) {
  if (geometry::InImage(camera, Eigen::Vector2d(camera.cx(), camera.cy()))) return;
  out->Warn("CAL-CENTRE",
            Format("camera %s: the principal point (%.0f, %.0f) lies outside its image of %d x %d", camera.name.c_str(),
                   camera.cx(), camera.cy(), camera.width_px, camera.height_px),
            "a cropped image or a shifted lens has such a centre; else boards do not determine it: show them tilted");
}

void JudgeGross(const CameraReport& camera, Judgement* out) {
  if (!(camera.holdout_gross_fraction > kWarnGross)) return;
  const std::string text =
      Format("camera %s: %.1f %% of the held-out corners are off by more than 5 px (good is below %.1f %%)",
             camera.name.c_str(), 100 * camera.holdout_gross_fraction, 100 * kWarnGross);
  const bool fail = camera.holdout_gross_fraction > kFailGross;
  const char* const hint =
      fail ? "boards were found wrongly, or the lens model does not fit: look at the worst boards, and name no option 'model'"
           : "look at the worst boards: blur, glare, a hand over the board";
  fail ? out->Fail("CAL-GROSS", text, hint) : out->Warn("CAL-GROSS", text, hint);
}

/// The first of the hints of one kind, else `otherwise`.
std::string HintOf(const std::vector<FilmHint>& hints, const char* code, const std::string& otherwise) {
  const auto found = std::find_if(hints.begin(), hints.end(), [&](const FilmHint& hint) { return hint.code == code; });
  return found == hints.end() ? otherwise : found->text;
}

/// The parts of a camera's image that lack boards, else `otherwise`. film_next says more of them.
std::string BriefHint(const std::vector<FilmHint>& hints, int camera_idx, const std::string& otherwise) {
  for (const FilmHint& hint : hints) {
    if (hint.camera_idx == camera_idx && !hint.brief.empty()) return hint.brief;
  }
  return otherwise;
}

/// Limits for a camera of the result, those of an ordinary image where it has none.
PixelLimits LimitsOf(const CalibrateReport& report, size_t camera) {
  return camera < report.rig.cameras.size() ? PixelLimitsOf(report.rig.cameras[camera].camera, report.need_px) : PixelLimits();
}

/// How uncertain its projections are; "": not worth a word. The level goes to `fails`.
std::string Uncertain(const CameraUncertainty& camera, const PixelLimits& limits, bool wide, bool* fails) {
  *fails = camera.edge_px > limits.fail_side_px;
  if (!std::isfinite(camera.edge_px)) return "how uncertain its projections are cannot be said";
  if (camera.edge_px > limits.side_px)
    return Format("projections at the image's sides are uncertain by %.2f px (good is below %.1f)", camera.edge_px,
                  limits.side_px);
  // Beyond the circle of a wide lens there is no image.
  if (!wide && camera.corner_px > limits.corner_px)
    return Format("projections in the image's corners are uncertain by %.1f px", camera.corner_px);
  return "";
}

/// What boards did not reach, in one line a camera.
void JudgeReach(const CalibrateReport& report, size_t c, const std::vector<FilmHint>& hints, Judgement* out) {
  const CameraReport& camera = report.cameras[c];
  const auto& all = report.uncertainty.cameras;
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const CameraUncertainty& other) { return other.name == camera.name; });
  bool fails = false;
  std::string text;
  if (found != all.end()) text = Uncertain(*found, LimitsOf(report, c), geometry::IsWide(camera.model), &fails);
  const char* const code = text.empty() ? "CAL-LOWCOV" : "CAL-UNCERTAIN";
  if (camera.coverage < kWarnCoverage && !camera.lens_held)
    text += (text.empty() ? "" : "; ") + Format("boards cover %.0f %% of the image (coverage)", 100 * camera.coverage);
  if (text.empty()) return;
  const std::string more = "show the board near the image's edges, tilted, and in more places";
  const std::string hint =
      BriefHint(hints, static_cast<int>(c), more) + (camera.lens_beyond.empty() ? "" : "; " + camera.lens_beyond);
  text = "camera " + camera.name + ": " + text;
  fails ? out->Fail(code, text, hint) : out->Warn(code, text, hint);
}

void JudgeVolume(const UncertaintySummary& uncertainty, const std::string& hint, Judgement* out) {
  std::vector<double> ranges;
  for (const CameraUncertainty& camera : uncertainty.cameras) {
    if (camera.range_m > 0) ranges.push_back(camera.range_m);
  }
  if (ranges.empty()) return;
  const double share = uncertainty.volume_mm / (1e3 * UpperMedian(std::move(ranges)));
  if (!(share > kWarnVolume)) return;
  const std::string text = Format("points are uncertain by %.3g mm, %.2f %% of the boards' distance (good is below %.1f %%)",
                                  uncertainty.volume_mm, 100 * share, 100 * kWarnVolume);
  share > kFailVolume ? out->Fail("CAL-VOLUME", text, hint) : out->Warn("CAL-VOLUME", text, hint);
}

const char* UnsolvedHint(Status status, bool in_rig) {
  switch (status) {
    case Status::kTooFewViews:
      return in_rig ? "film more boards, with two cameras or more seeing each of them" : "film more boards";
    case Status::kDegenerate:
      return in_rig ? "film the board tilted, near and far, and shown to neighbouring cameras at once"
                    : "film the board tilted, near and far";
    case Status::kNotConverged:
    case Status::kBehindCamera:
      return in_rig ? "check the board's size and numbering, and that frames with the same number were taken at the same time"
                    : "check the board's size and numbering";
    default:
      return "check the board's description and the images";
  }
}

/// NaN figures pass no comparison, so they are checked explicitly.
bool HasFigures(const CalibrateReport& report) {
  bool finite = std::isfinite(report.rms_px) && std::isfinite(report.sigma_px) && report.num_corners > 0;
  for (const CameraReport& camera : report.cameras)
    finite = finite && std::isfinite(camera.focal_px) && std::isfinite(camera.focal_sigma_px) && std::isfinite(camera.rms_px);
  return finite;
}

void JudgeFrames(const CalibrateReport& report, Judgement* out) {
  if (!report.held_conflict.empty())
    out->Warn("CAL-HELD", report.held_conflict,
              "leave the camera out of option 'fix', or check that the calibration is that of this footage");
  if (!report.frames_conflict.empty())
    out->Warn("CAL-FRAMES", report.frames_conflict,
              report.frame_shift.empty() && report.frame_rates.empty() && report.frame_drops.empty()
                  ? "check that frames with the same number were taken at the same time"
                  : "number the frames by their time stamps");
  double scale = 1;
  for (size_t c = 0; c < report.cameras.size(); ++c) scale = std::max(scale, internal::PixelScale(report, c));
  out->Limit(report.rig_holdout_rms_px, kWarnHoldoutPx * scale, kFailHoldoutPx * scale, "CAL-RIGHOLDOUT",
             Format("frames held out: error %.2f px over all cameras (good is below %.1f)", report.rig_holdout_rms_px,
                    kWarnHoldoutPx * scale),
             "check that the cameras are synchronised and did not move while the boards were filmed");
}

void JudgeData(const CalibrateReport& report, size_t c, Judgement* out) {
  const CameraReport& camera = report.cameras[c];
  const char* name = camera.name.c_str();
  if (camera.num_places < kWarnViews && !camera.lens_held && !camera.points_in_space) {
    const bool repeated = camera.num_places < camera.num_views;
    out->Warn("CAL-FEWVIEWS",
              Format("camera %s: only %d boards", name, camera.num_views) +
                  (repeated ? Format(" in %d places", camera.num_places) : ""),
              Format("%d places or more are better", kWarnViews));
  }
  if (c < report.rig.cameras.size() && geometry::FoldsInside(report.rig.cameras[c].camera)) {
    out->Warn(
        "CAL-FOLD",
        Format(
            "camera %s: its lens (%s) folds over in %.0f %% of the image: no rays in %s, from %.0f px off the principal point",
            name, std::string(geometry::ToString(camera.model)).c_str(), 100 * ShareWithoutRay(report.rig.cameras[c].camera),
            camera.folds.where.c_str(), camera.folds.nearest_px),
        "choose a simpler option 'model' or show the board there" +
            (camera.lens_beyond.empty() ? "" : "; " + camera.lens_beyond));
  }
}

void JudgeRejected(const CalibrateReport& report, Judgement* out) {
  const double share = std::max(0.0, report.rejected_fraction - internal::SlightlyRejected(report, -1));
  const std::string text = Format("%.0f %% of the corners were rejected", 100 * share);
  const char* const hint = "check the board's description and that it is flat and sharp in the images";
  out->Limit(share, kWarnRejected, kFailRejected, "CAL-REJECTED", text, hint);
}

/// Causes come before what follows from them: 0 the input and the recording, 1 the lenses, 2 errors that either explains, 3
/// what the result is then worth.
int Consequence(const std::string& code) {
  static const std::map<std::string, int> kRanks = {
      {"CAL-ASSUMED", 1},  {"CAL-FOCAL", 1},       {"CAL-CENTRE", 1},      {"CAL-ASPECT", 1},     {"CAL-FOLD", 1},
      {"CAL-FEWVIEWS", 1}, {"CAL-NOHOLDOUT", 1},   {"CAL-CONTRADICTS", 2}, {"CAL-NOCORNERS", 2},  {"CAL-REJECTED", 2},
      {"CAL-LOST", 2},     {"CAL-GROSS", 2},       {"CAL-HOLDOUT", 2},     {"CAL-RIGHOLDOUT", 2}, {"CAL-TRIANGULATED", 2},
      {"CAL-STRAY", 2},    {"CAL-UNEXPLAINED", 2}, {"CAL-LENGTHS", 3},     {"CAL-UNCERTAIN", 3},  {"CAL-LOWCOV", 3},
      {"CAL-VOLUME", 3}};
  const auto found = kRanks.find(code);
  return found == kRanks.end() ? 0 : found->second;
}

}  // namespace

Verdict Judge(const CalibrateReport& report) {
  Judgement judgement;
  if (report.status != Status::kOk) {
    const std::string& why = report.message;
    judgement.Fail("CAL-UNSOLVED",
                   why.empty() ? Format("there is no solution: %s", std::string(ToString(report.status)).c_str()) : why,
                   UnsolvedHint(report.status, report.cameras.size() != 1));
    return judgement.verdict;
  }
  if (!HasFigures(report)) judgement.Fail("CAL-UNSOLVED", "the solution has figures that are no numbers", "check the input");
  JudgeRejected(report, &judgement);
  const std::vector<FilmHint> hints = CaptureAdvice(report);
  for (size_t c = 0; c < report.cameras.size(); ++c) {
    JudgeError(report.cameras[c], internal::PixelScale(report, c), report.cameras.size() > 1, &judgement);
    JudgeGross(report.cameras[c], &judgement);
    JudgeFocal(report.cameras[c], &judgement);
    if (c < report.rig.cameras.size() && !report.cameras[c].lens_held) JudgeCentre(report.rig.cameras[c].camera, &judgement);
    JudgeData(report, c, &judgement);
    JudgeReach(report, c, hints, &judgement);
  }
  JudgeVolume(report.uncertainty,
              HintOf(hints, "FILM-LINK", "show the board to several cameras at once, in more places of the volume"),
              &judgement);
  JudgeFrames(report, &judgement);
  internal::JudgeEvidence(report, &judgement);
  std::stable_sort(judgement.verdict.reasons.begin(), judgement.verdict.reasons.end(),
                   [](const Notice& a, const Notice& b) { return Consequence(a.code) < Consequence(b.code); });
  return judgement.verdict;
}

}  // namespace mvstudio::calib
