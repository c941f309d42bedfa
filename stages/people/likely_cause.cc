#include "stages/people/likely_cause.h"

#include <algorithm>

#include "core/format.h"

namespace mvstudio::stages {
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

/// What to do about clocks that do not fit: nothing that was done already.
std::string TimingRemedy(const triangulate::CauseTrial& trial, bool timed) {
  if (!timed) return trial.remedy;
  return "the offsets that were given do not hold for this take: find them anew with `mvstudio sync`, or leave them out";
}

/// The motion asks for offsets that change the residuals little: it is slow, or errors of the calibration hide it. Said where
/// they change them at all.
void WarnOfTiming(const triangulate::CauseReport& report, bool timed, CommandResult* result) {
  constexpr double kLeastGain = 0.05;
  if (report.trials.empty()) return;
  const triangulate::CauseTrial& trial = report.trials[0];
  if (trial.offset_frames < 0.5 || trial.residual_px > (1 - kLeastGain) * report.as_given.residual_px) return;
  AddMetrics(report, result);
  result->warnings.push_back(
      {"TRI-TIMING",
       "the motion says that the cameras are not synchronous: it fits " + trial.assumption +
           Format("; mean residual %.2f px instead of %.2f px", trial.residual_px, report.as_given.residual_px),
       TimingRemedy(trial, timed)});
}

/// What the best assumptions would leave; none of them explains the take.
std::string NothingExplains(const triangulate::CauseReport& report) {
  constexpr size_t kShown = 3;
  std::string text =
      Format("none of the likely causes explains it: of the detections in a sample %.3g %% fit together as given",
             100 * report.as_given.carried);
  for (size_t i = 0; i < std::min(kShown, report.trials.size()); ++i)
    text += Format(", %.3g %% ", 100 * report.trials[i].carried) + report.trials[i].assumption;
  return text;
}

}  // namespace

std::string AddLikelyCause(const triangulate::CauseReport& report, const std::string& code, const std::string& otherwise,
                           CommandResult* result) {
  AddMetrics(report, result);
  if (report.message.empty()) {
    if (report.as_given.num_detections > 0 && !report.trials.empty())
      result->warnings.push_back({code, NothingExplains(report), otherwise});
    return otherwise;
  }
  const std::string remedy = report.trials[0].remedy;
  result->warnings.push_back({code, "likeliest cause: " + report.message, remedy});
  return remedy;
}

bool AddTiming(const triangulate::CauseReport& report, bool timed, CommandResult* result) {
  if (report.message.empty()) {
    WarnOfTiming(report, timed, result);
    return false;
  }
  AddMetrics(report, result);
  const triangulate::CauseTrial& trial = report.trials[0];
  const Notice notice{"TRI-TIMING", "the cameras are not synchronous: " + report.message, TimingRemedy(trial, timed)};
  if (trial.offset_frames < 0.5 && trial.cause != triangulate::Cause::kRates) {
    result->warnings.push_back(notice);
  } else {
    result->exit = kExitQualityGate;
    result->errors.push_back(notice);
  }
  return true;
}

bool AddCameraCause(const triangulate::CauseReport& report, bool timed, CommandResult* result) {
  using triangulate::Cause;
  if (!report.trials.empty()) AddMetrics(report, result);
  if (report.message.empty() || report.trials[0].cause == Cause::kMoved) return false;
  const triangulate::CauseTrial& trial = report.trials[0];
  if (trial.cause == Cause::kTimeOffset || trial.cause == Cause::kRates) return AddTiming(report, timed, result);
  result->exit = kExitQualityGate;
  result->errors.push_back({"TRI-CAUSE", "likeliest cause: " + report.message, trial.remedy});
  return true;
}

}  // namespace mvstudio::stages
