#include "app/people/likely_cause.h"

#include "core/format.h"

namespace mvstudio::app {
namespace {

nlohmann::ordered_json ToJson(const triangulate::CauseTrial& trial) {
  return {{"cause", std::string(ToString(trial.cause))},
          {"assumption", trial.assumption},
          {"carried", trial.carried},
          {"residual_px", trial.residual_px},
          {"clear", trial.clear}};
}

void AddMetrics(const triangulate::CauseReport& report, CommandResult* result) {
  auto& causes = result->metrics["causes"] = nlohmann::ordered_json::array();
  causes.push_back(ToJson(report.as_given));
  for (const triangulate::CauseTrial& trial : report.trials) causes.push_back(ToJson(trial));
}

/// The motion asks for offsets that change the residuals little: it is slow, or errors of the calibration hide it.
void WarnOfTiming(const triangulate::CauseReport& report, CommandResult* result) {
  if (report.trials.empty()) return;
  const triangulate::CauseTrial& trial = report.trials[0];
  if (trial.offset_frames < 0.5 || trial.residual_px >= report.as_given.residual_px) return;
  AddMetrics(report, result);
  result->warnings.push_back(
      {"TRI-TIMING",
       "the motion says that the cameras are not synchronous: it fits " + trial.assumption +
           Format("; mean residual %.2f px instead of %.2f px", trial.residual_px, report.as_given.residual_px),
       trial.remedy});
}

}  // namespace

std::string AddLikelyCause(const triangulate::CauseReport& report, const std::string& code, const std::string& otherwise,
                           CommandResult* result) {
  AddMetrics(report, result);
  if (report.message.empty()) return otherwise;
  const std::string remedy = report.trials[0].remedy;
  result->warnings.push_back({code, "likeliest cause: " + report.message, remedy});
  return remedy;
}

bool AddTiming(const triangulate::CauseReport& report, CommandResult* result) {
  if (report.message.empty()) {
    WarnOfTiming(report, result);
    return false;
  }
  AddMetrics(report, result);
  const triangulate::CauseTrial& trial = report.trials[0];
  const Notice notice{"TRI-TIMING", "the cameras are not synchronous: " + report.message, trial.remedy};
  if (trial.offset_frames < 0.5) {
    result->warnings.push_back(notice);
  } else {
    result->exit = kExitQualityGate;
    result->errors.push_back(notice);
  }
  return true;
}

}  // namespace mvstudio::app
