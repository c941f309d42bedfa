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

}  // namespace

std::string AddLikelyCause(const triangulate::CauseReport& report, const std::string& code, const std::string& otherwise,
                           CommandResult* result) {
  auto& causes = result->metrics["causes"] = nlohmann::ordered_json::array();
  causes.push_back(ToJson(report.as_given));
  for (const triangulate::CauseTrial& trial : report.trials) causes.push_back(ToJson(trial));
  if (report.message.empty()) return otherwise;
  const std::string remedy = report.trials[0].remedy;
  result->warnings.push_back({code, "likeliest cause: " + report.message, remedy});
  return remedy;
}

}  // namespace mvstudio::app
