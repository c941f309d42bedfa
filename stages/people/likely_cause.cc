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

nlohmann::ordered_json CausesJson(const triangulate::CauseReport& report) {
  nlohmann::ordered_json causes = nlohmann::ordered_json::array({ToJson(report.as_given)});
  for (const triangulate::CauseTrial& trial : report.trials) causes.push_back(ToJson(trial));
  return causes;
}

/// What to do about clocks that do not fit: nothing that was done already.
std::string TimingRemedy(const triangulate::CauseTrial& trial, bool timed) {
  if (!timed) return trial.remedy;
  return "the offsets that were given do not hold for this take: find them anew with `mvstudio sync`, or leave them out";
}

/// The motion asks for offsets that change the residuals little: it is slow, or errors of the calibration hide it. Said where
/// they change them at all.
CommandResult SlightTiming(const triangulate::CauseReport& report, bool timed) {
  constexpr double kLeastGain = 0.05;
  CommandResult result;
  if (report.trials.empty()) return result;
  const triangulate::CauseTrial& trial = report.trials[0];
  if (trial.offset_frames < 0.5 || trial.residual_px > (1 - kLeastGain) * report.as_given.residual_px) return result;
  result.metrics["causes"] = CausesJson(report);
  result.warnings.push_back(
      {"TRI-TIMING",
       "the motion says that the cameras are not synchronous: it fits " + trial.assumption +
           Format("; mean residual %.2f px instead of %.2f px", trial.residual_px, report.as_given.residual_px),
       TimingRemedy(trial, timed)});
  return result;
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

bool IsTiming(const triangulate::CauseTrial& trial) {
  return trial.cause == triangulate::Cause::kTimeOffset || trial.cause == triangulate::Cause::kRates;
}

/// The trials of the clocks, a clear one first, with its message also where another cause fits better.
triangulate::CauseReport ClocksAlone(const triangulate::CauseReport& report) {
  triangulate::CauseReport clocks = report;
  clocks.message.clear();
  std::vector<triangulate::CauseTrial>& trials = clocks.trials;
  trials.erase(std::remove_if(trials.begin(), trials.end(), [](const auto& trial) { return !IsTiming(trial); }), trials.end());
  const auto clear = std::find_if(trials.begin(), trials.end(), [](const auto& trial) { return trial.clear; });
  if (clear == trials.end()) return clocks;
  std::rotate(trials.begin(), clear, clear + 1);
  clocks.message =
      IsTiming(report.trials[0])
          ? report.message
          : trials[0].assumption +
                Format(
                    ", %.3g %% of the detections in a sample fit together, as given %.3g %%; mean residual %.2f px "
                    "instead of %.2f px",
                    100 * trials[0].carried, 100 * report.as_given.carried, trials[0].residual_px, report.as_given.residual_px);
  return clocks;
}

/// The first trial is the cause.
CauseFinding ErrorOf(const triangulate::CauseReport& report) {
  CauseFinding finding{{}, true, report.trials[0].remedy};
  finding.said.metrics["causes"] = CausesJson(report);
  finding.said.exit = kExitQualityGate;
  finding.said.errors.push_back({"TRI-CAUSE", "likeliest cause: " + report.message, finding.remedy});
  return finding;
}

}  // namespace

CauseFinding CauseOfLoss(const std::optional<triangulate::CauseReport>& given, const std::string& code,
                         const std::string& otherwise) {
  if (!given) return {{}, false, otherwise};
  const triangulate::CauseReport& report = *given;
  CauseFinding finding{{}, !report.message.empty(), otherwise};
  finding.said.metrics["causes"] = CausesJson(report);
  if (finding.clear) {
    finding.remedy = report.trials[0].remedy;
    finding.said.warnings.push_back({code, "likeliest cause: " + report.message, finding.remedy});
  } else if (report.as_given.num_detections > 0 && !report.trials.empty()) {
    finding.said.warnings.push_back({code, NothingExplains(report), otherwise});
  }
  return finding;
}

CauseFinding CauseInTiming(const triangulate::CauseReport& report, bool timed) {
  if (report.message.empty()) return {SlightTiming(report, timed)};
  const triangulate::CauseTrial& trial = report.trials[0];
  CauseFinding finding{{}, true, TimingRemedy(trial, timed)};
  finding.said.metrics["causes"] = CausesJson(report);
  const Notice notice{"TRI-TIMING", "the cameras are not synchronous: " + report.message, finding.remedy};
  if (trial.offset_frames < 0.5 && trial.cause != triangulate::Cause::kRates) {
    finding.said.warnings.push_back(notice);
  } else {
    finding.said.exit = kExitQualityGate;
    finding.said.errors.push_back(notice);
  }
  return finding;
}

CauseFinding CauseInCamera(const triangulate::CauseReport& report, bool timed) {
  using triangulate::Cause;
  if (report.message.empty() || report.trials[0].cause == Cause::kMoved) {
    CauseFinding finding;
    if (!report.trials.empty()) finding.said.metrics["causes"] = CausesJson(report);
    return finding;
  }
  const triangulate::CauseTrial& trial = report.trials[0];
  if (IsTiming(trial)) return CauseInTiming(report, timed);
  return ErrorOf(report);
}

CauseFinding CauseInScatter(const triangulate::CauseReport& report, bool timed) {
  using triangulate::Cause;
  // Fewer cameras fit better anyhow where all are off a little: what is left without the one to blame is noise.
  constexpr double kHalf = 0.5, kNoise = 0.2;
  const bool moved = !report.message.empty() && report.trials[0].cause == Cause::kMoved;
  const bool clear =
      !report.message.empty() && report.trials[0].residual_px <= (moved ? kNoise : kHalf) * report.as_given.residual_px;
  if (clear && moved) return ErrorOf(report);
  if (clear) return CauseInCamera(report, timed);
  return CauseInTiming(ClocksAlone(report), timed);
}

}  // namespace mvstudio::stages
