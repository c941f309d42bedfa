// Private: the rules of Judge, for verdict*.cc and calibrate*.cc.
#pragma once

#include <string>

#include "calib/calibrate.h"

namespace mvstudio::calib::internal {

class Judgement {
 public:
  void Warn(const char* code, const std::string& text, const std::string& hint) { verdict.Warn({code, text, hint}); }
  void Fail(const char* code, const std::string& text, const std::string& hint) { verdict.Fail({code, text, hint}); }
  /// Fails above `fail`, warns above `warn`, passes smaller values and NaN.
  void Limit(double value, double warn, double fail, const char* code, const std::string& text, const std::string& hint) {
    if (value > fail) return Fail(code, text, hint);
    if (value > warn) Warn(code, text, hint);
  }
  Verdict verdict;
};

/// A camera contradicts the others if its error in the rig exceeds its own by this ratio and this many pixels.
constexpr double kContradictsRatio = 1.5, kContradictsPx = 0.3;

/// Factor on limits in pixels: 1 up to a full-HD image, in proportion to the diagonal beyond.
double PixelScale(const CalibrateReport& report, size_t camera);

/// Share of all corners, or of one camera's, that were rejected although they are nowhere off by more than a sharp detector is:
/// where corners are nearly perfect, the limit of so many standard deviations is a few hundredths of a pixel.
double SlightlyRejected(const CalibrateReport& report, int camera_idx);

inline const char* const kTimeHint =
    "check that frames with the same number were taken at the same time, and that no camera was moved";

/// Whether cells or pixels are not square, where the boards leave it open.
void JudgeAspect(const CalibrateReport& report, Judgement* out);

/// Lengths on the triangulated boards; `scale` as of PixelScale, the largest.
void JudgeLengths(const CalibrateReport& report, double scale, Judgement* out);

/// Judges the contradictions of a camera's boards with those of the others, or with each other.
void JudgeEvidence(const CalibrateReport& report, Judgement* out);

}  // namespace mvstudio::calib::internal
