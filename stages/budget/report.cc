#include "stages/budget/report.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include "core/disk/files.h"
#include "core/disk/trace.h"
#include "core/error.h"
#include "core/format.h"
#include "core/log.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

std::string BudgetErrorText(const BudgetReport& report, double error) {
  if (!std::isfinite(error)) return "an error that cannot be judged";
  if (report.unit == ErrorUnit::kSsim) return Format("SSIM %.4f", 1 - error);
  return Format("%.3g %s", error, std::string(ToString(report.unit)).c_str());
}

/// "12s (give or take 0.8s)".
std::string TimeText(const SettingTrial& trial) {
  const std::string seconds = SecondsText(trial.predicted_s);
  if (!(trial.predicted_sigma_s > 0)) return seconds;
  return seconds + " (give or take " + SecondsText(trial.predicted_sigma_s) + ")";
}

std::string TrialText(const BudgetReport& report, const SettingTrial& trial) {
  const std::string what = trial.Name() + (trial.what.empty() ? "" : " (" + trial.what + ")");
  if (!trial.IsTried()) return what + ": not tried, " + trial.why_not;
  return what + ": " + TimeText(trial) + ", " + BudgetErrorText(report, trial.error) +
         (trial.short_of.empty() ? "" : "; " + trial.short_of);
}

/// Whether another setting was foretold a smaller error, by less than the trial can tell.
bool IsTied(const BudgetReport& report) {
  return std::any_of(report.trials.begin(), report.trials.end(), [&](const SettingTrial& trial) {
    return trial.IsTried() && trial.error < report.Chosen().error && trial.predicted_s <= report.asked.BudgetSeconds();
  });
}

std::string ReasonOf(const BudgetReport& report) {
  const SettingTrial& chosen = report.Chosen();
  const std::string what = chosen.Name() + ": ";
  if (report.choice.outcome == SettingChoice::Outcome::kBestWithinBudget)
    return what +
           (IsTied(report) ? "no other that was tried within the budget is shown to be better"
                           : "the best of what was tried within the budget") +
           "; none reaches " + report.asked.target;
  if (!report.asked.target.empty()) return what + "the cheapest of what was tried that reaches " + report.asked.target;
  const bool all =
      std::none_of(report.trials.begin(), report.trials.end(), [](const SettingTrial& trial) { return !trial.IsTried(); });
  return what + (all ? "nothing" : "nothing that was tried") + " within the budget is better by more than a standard error";
}

ordered_json SettingJson(const SettingTrial& trial) {
  ordered_json json = ordered_json::object();
  for (const auto& [option, value] : trial.flags) json[option] = value;
  return json;
}

ordered_json TrialJson(const SettingTrial& trial) {
  ordered_json json = {{"settings", SettingJson(trial)}};
  if (!trial.what.empty()) json["what"] = trial.what;
  if (!trial.IsTried()) {
    json["not_tried"] = trial.why_not;
    return json;
  }
  for (const WorkPart& part : trial.parts) {
    ordered_json row = {{"part", part.name}, {"grows_until", FiniteOrNull(part.most_size)}};
    for (const SizedTiming& timing : part.timings)
      row["sizes"].push_back(timing.size), row["seconds"].push_back(timing.seconds);
    json["timings"].push_back(row);
  }
  json["size"] = FiniteOrNull(trial.size);
  json["predicted_seconds"] = FiniteOrNull(trial.predicted_s);
  json["predicted_seconds_sigma"] = FiniteOrNull(trial.predicted_sigma_s);
  json["error"] = FiniteOrNull(trial.error), json["error_sigma"] = FiniteOrNull(trial.error_sigma);
  return json;
}

/// What both the result and the file of predictions hold.
ordered_json PredictionJson(const BudgetReport& report) {
  ordered_json json;
  json["asked"] = {{"budget", report.asked.budget}, {"target", report.asked.target}};
  json["trial_seconds"] = report.trial_s;
  json["predicted_seconds"] = FiniteOrNull(report.Chosen().predicted_s);
  json["predicted_seconds_sigma"] = FiniteOrNull(report.Chosen().predicted_sigma_s);
  json["predicted_error"] = FiniteOrNull(report.Chosen().error);
  json["actual_seconds"] = FiniteOrNull(report.actual_s);
  json["actual_error"] = FiniteOrNull(report.actual_error);
  json["error_unit"] = std::string(ToString(report.unit));
  json["chosen"] = SettingJson(report.Chosen());
  return json;
}

/// Mean number of processes that run; NaN where the system does not say.
double LoadNow() {
  double load = 0;
  return getloadavg(&load, 1) == 1 ? load : std::nan("");
}

ordered_json MachineJson(const BudgetReport& report) {
  ordered_json json = {{"processor", ProcessorName()}, {"cores", std::thread::hardware_concurrency()}};
  json["load_at_trial"] = FiniteOrNull(report.load), json["load"] = FiniteOrNull(LoadNow());
  return json;
}

/// A trial of the clock's seconds foretells them for a machine that stays as busy.
std::string LoadText(const BudgetReport& report) {
  const double now = LoadNow();
  if (!std::isfinite(report.load) || !std::isfinite(now)) return "";
  return Format(" (%.1f processes ran after the trial, %.1f run now)", report.load, now);
}

/// A budget that was not kept.
std::vector<Notice> LateWarnings(const BudgetReport& report) {
  if (!(report.actual_s > report.asked.BudgetSeconds())) return {};
  return {{"BUD-LATE",
           "option 'budget' " + report.asked.budget + " is exceeded: it took " + SecondsText(report.actual_s) + ", " +
               SecondsText(report.Chosen().predicted_s) + " was predicted" + LoadText(report),
           "times hold for a machine that stays as busy as in the trial: run it alone, or give more time"}};
}

/// What did not come out as it was asked for, or far from what the trial let expect.
std::vector<Notice> WarningsOf(const BudgetReport& report) {
  constexpr double kFar = 1.5;  // times the error that was predicted
  const SettingTrial& chosen = report.Chosen();
  const std::string predicted = BudgetErrorText(report, chosen.error), came = BudgetErrorText(report, report.actual_error);
  const std::string better = report.better_data + " would lower it, more time would not";
  const std::optional<ErrorTarget> target = report.asked.Target();
  if (target && !(report.actual_error <= target->value)) {
    if (report.choice.outcome == SettingChoice::Outcome::kBestWithinBudget)
      return {{"BUD-TARGET",
               "option 'target' " + report.asked.target + " was out of reach: " + predicted +
                   " was predicted, and it came out at " + came,
               report.asked.budget.empty() ? better : "give more time, or " + report.better_data}};
    return {
        {"BUD-TARGET",
         "option 'target' " + report.asked.target + " is missed: " + predicted + " was predicted, and it came out at " + came,
         "ask for less than what is needed, or leave option 'target' out"}};
  }
  if (report.actual_error > kFar * chosen.error)
    return {{"BUD-PREDICTION", "the error came out at " + came + ", " + predicted + " was predicted",
             "parts of the data were no guide to the whole: give more time, or leave option 'budget' out"}};
  return {};
}

}  // namespace

std::string ProcessorName() {
  const std::string text = ReadFile("/proc/cpuinfo");
  const size_t key = text.find("model name"), colon = text.find(": ", key);
  if (key == std::string::npos || colon == std::string::npos) return "";
  return text.substr(colon + 2, text.find('\n', colon) - colon - 2);
}

void Choose(double elapsed_s, BudgetReport* report) {
  report->load = LoadNow();
  for (SettingTrial& trial : report->trials) {
    if (!trial.IsTried()) continue;
    const Foretold seconds = ForetellSeconds(trial.parts, trial.size);
    trial.predicted_s = elapsed_s + seconds.value;
    trial.predicted_sigma_s = std::max(seconds.sigma, report->least_relative_sigma * trial.predicted_s);
  }
  const std::optional<ErrorTarget> target = report->asked.Target();
  report->choice = ChooseSetting(report->trials, report->asked.BudgetSeconds(), target ? target->value : std::nan(""));
  const SettingTrial& chosen = report->Chosen();
  if (report->choice.outcome == SettingChoice::Outcome::kNothingFits) {
    throw UsageError("option 'budget' " + report->asked.budget + ": the cheapest setting, " + chosen.Name() +
                     ", is predicted to take " + TimeText(chosen) + "; give more time, or " + report->less_work);
  }
  Log(LogLevel::kInfo,
      "budget: " + ReasonOf(*report) + "; predicted " + TimeText(chosen) + ", " + BudgetErrorText(*report, chosen.error));
  if (report->choice.outcome == SettingChoice::Outcome::kBestWithinBudget)
    Log(LogLevel::kWarning, "option 'target' " + report->asked.target + " is out of reach: " +
                                (IsTied(*report) ? "foretold is " : "the best is ") + BudgetErrorText(*report, chosen.error));
}

CommandResult Describe(const BudgetReport& report) {
  CommandResult result;
  ordered_json& json = result.metrics["budget"] = PredictionJson(report);
  json["reasons"].push_back(ReasonOf(report));
  for (const std::string& reason : report.reasons) json["reasons"].push_back(reason);
  for (const SettingTrial& trial : report.trials) json["reasons"].push_back(TrialText(report, trial));
  for (const SettingTrial& trial : report.trials) json["trials"].push_back(TrialJson(trial));
  const SettingTrial& chosen = report.Chosen();
  const double share = report.trial_s / report.actual_s;
  json["trial_share"] = FiniteOrNull(share);
  result.text = "chosen by a trial of " + SecondsText(report.trial_s) +
                (std::isfinite(share) ? Format(", %.0f %% of the time", 100 * share) : "") + ": " + ReasonOf(report) +
                "\npredicted " + TimeText(chosen) + " on a machine that stays as busy, " +
                BudgetErrorText(report, chosen.error) + "; came out " + SecondsText(report.actual_s) + ", " +
                BudgetErrorText(report, report.actual_error) + "\n";
  for (const std::string& reason : report.reasons) result.text += "  " + reason + "\n";
  for (const Notice& warning : WarningsOf(report)) result.warnings.push_back(warning);
  for (const Notice& warning : LateWarnings(report)) result.warnings.push_back(warning);
  return result;
}

void KeepPrediction(const BudgetReport& report, const std::string& folder) {
  const UntracedScope untraced;  // what is kept of earlier runs is no output of this one
  ordered_json json = {{"stage", report.stage}};
  json.update(PredictionJson(report));
  for (const auto& [what, count] : report.sizes) json["sizes"][what] = count;
  json["threads"] = report.threads;
  json["machine"] = MachineJson(report);
  AppendLine((std::filesystem::path(folder) / kPredictionsFile).string(), json.dump());
}

}  // namespace mvstudio::stages
