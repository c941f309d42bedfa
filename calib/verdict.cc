#include <cmath>
#include <cstdarg>
#include <cstdio>

#include "calib/calibrate.h"

namespace mvstudio::calib {
namespace {

constexpr double kWarnHoldoutPx = 1.0, kFailHoldoutPx = 3.0;
constexpr double kWarnHoldoutRatio = 1.5;
constexpr double kWarnRejected = 0.10, kFailRejected = 0.40;
constexpr double kWarnFocalSigma = 0.01, kFailFocalSigma = 0.10;
constexpr double kWarnCoverage = 0.40;
constexpr int kWarnViews = 8;

#if defined(__GNUC__)
__attribute__((format(printf, 1, 2)))
#endif
std::string
Text(const char* format, ...) {
  char buffer[300];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer, sizeof buffer, format, arguments);
  va_end(arguments);
  return buffer;
}

class Judgement {
 public:
  void Warn(const char* code, const std::string& text, const std::string& hint) { Add("warn", {code, text, hint}); }
  void Fail(const char* code, const std::string& text, const std::string& hint) { Add("fail", {code, text, hint}); }
  Verdict verdict;

 private:
  void Add(const std::string& status, const Verdict::Reason& reason) {
    if (verdict.status != "fail") verdict.status = status;
    verdict.reasons.push_back(reason);
  }
};

void JudgeError(const CameraReport& camera, Judgement* out) {
  const char* name = camera.name.c_str();
  const double holdout = camera.holdout_rms_px;
  if (holdout > kFailHoldoutPx) {
    out->Fail("CAL-HOLDOUT", Text("camera %s: held-out error %.2f px (limit %.1f)", name, holdout, kFailHoldoutPx),
              "check the board's size and numbering, blur, and that the footage is synchronised");
  } else if (holdout > kWarnHoldoutPx) {
    out->Warn("CAL-HOLDOUT", Text("camera %s: held-out error %.2f px (good is below %.1f)", name, holdout, kWarnHoldoutPx),
              "use sharper images and a flat board");
  }
  if (holdout > kWarnHoldoutRatio * camera.rms_px && holdout > 0.2) {
    out->Warn("CAL-HOLDOUT",
              Text("camera %s: held-out error %.2f px against %.2f px on its own boards", name, holdout, camera.rms_px),
              "film more boards, in more varied poses");
  }
}

void JudgeFocal(const CameraReport& camera, Judgement* out) {
  const double percent = 100 * camera.focal_sigma_px / camera.focal_px;
  const std::string text = Text("camera %s: the focal length is known to %.1f %% only", camera.name.c_str(), percent);
  const char* const hint = "show the board tilted, and near as well as far";
  if (percent > 100 * kFailFocalSigma) {
    out->Fail("CAL-FOCAL", text, hint);
  } else if (percent > 100 * kWarnFocalSigma) {
    out->Warn("CAL-FOCAL", text, hint);
  }
}

void JudgeData(const CameraReport& camera, Judgement* out) {
  const char* name = camera.name.c_str();
  if (camera.num_views < kWarnViews) {
    out->Warn("CAL-FEWVIEWS", Text("camera %s: only %d boards", name, camera.num_views),
              Text("%d or more are better", kWarnViews));
  }
  if (camera.coverage < kWarnCoverage) {
    out->Warn("CAL-LOWCOV", Text("camera %s: boards cover %.0f %% of the image", name, 100 * camera.coverage),
              "the lens is extrapolated elsewhere: move the board to the image's edges");
  }
  if (!camera.covers_image) {
    out->Warn(
        "CAL-FOLD",
        Text("camera %s: the lens model folds over inside the image corners (valid radius %.2f)", name, camera.valid_radius),
        "choose a simpler --model or show the board in the corners");
  }
}

}  // namespace

Verdict Judge(const CalibrateReport& report) {
  Judgement judgement;
  if (report.status != Status::kOk) {
    judgement.Fail("CAL-UNSOLVED", report.message, "");
    return judgement.verdict;
  }
  const std::string rejected = Text("%.0f %% of the corners were rejected", 100 * report.rejected_fraction);
  if (report.rejected_fraction > kFailRejected) {
    judgement.Fail("CAL-REJECTED", rejected, "check the board's description and that it is flat and sharp in the images");
  } else if (report.rejected_fraction > kWarnRejected) {
    judgement.Warn("CAL-REJECTED", rejected, "check the board's description and that it is flat and sharp in the images");
  }
  for (const CameraReport& camera : report.cameras) {
    JudgeError(camera, &judgement);
    JudgeFocal(camera, &judgement);
    JudgeData(camera, &judgement);
  }
  return judgement.verdict;
}

}  // namespace mvstudio::calib
