#include <algorithm>
#include <cmath>

#include "report/scene/scene.h"

namespace mvstudio::report {
namespace {

/// Residual and missing joints of one time step.
struct StepError {
  double rms_px = std::numeric_limits<double>::quiet_NaN();
  size_t missing = 0;

  /// A residual counts for more than any number of joints that are missing.
  bool IsWorseThan(const StepError& other) const {
    if (std::isfinite(rms_px) != std::isfinite(other.rms_px)) return std::isfinite(rms_px);
    return std::isfinite(rms_px) ? rms_px > other.rms_px : missing > other.missing;
  }
};

StepError ErrorOf(const ScenePeople& people, size_t step) {
  StepError error;
  double sum = 0, count = 0;
  const size_t cells = people.people.size() * people.joints.size();
  for (size_t i = step * cells; i < (step + 1) * cells; ++i) {
    const SceneJoint& joint = people.cells[i];
    if (!std::isfinite(joint.at_m[0])) {
      ++error.missing;
    } else if (std::isfinite(joint.rms_px)) {
      sum += joint.rms_px * joint.rms_px, ++count;
    }
  }
  if (count > 0) error.rms_px = std::sqrt(sum / count);
  return error;
}

}  // namespace

std::vector<SceneSpan> SpansOf(const ScenePeople& people, size_t max_spans) {
  std::vector<SceneSpan> spans;
  const size_t steps = people.frames.size(), count = std::min(max_spans, steps),
               cells = people.people.size() * people.joints.size();
  for (size_t i = 0; i < count; ++i) {
    const size_t first = i * steps / count, end = (i + 1) * steps / count;
    SceneSpan span{first, first, 0, 0, first};
    StepError worst;
    size_t missing = 0, most = 0;
    for (size_t step = first; step < end; ++step) {
      const StepError error = ErrorOf(people, step);
      missing += error.missing;
      if (error.missing > most) most = error.missing, span.emptiest = step;
      if (step == first || error.IsWorseThan(worst)) worst = error, span.worst = step;
    }
    span.rms_px = worst.rms_px;
    span.missing = cells > 0 ? static_cast<double>(missing) / static_cast<double>(cells * (end - first)) : 0;
    spans.push_back(span);
  }
  return spans;
}

}  // namespace mvstudio::report
