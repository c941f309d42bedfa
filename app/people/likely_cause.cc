#include "app/people/likely_cause.h"

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
  if (report.message.empty()) return false;
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
