#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stages/budget/ask.h"
#include "stages/budget/choose.h"
#include "stages/result.h"

/// What was predicted, and what came of it.
namespace mvstudio::stages {

struct BudgetReport {
  std::string stage;  ///< "triangulate"
  BudgetOptions asked;
  ErrorUnit unit = ErrorUnit::kPx;
  std::vector<std::pair<std::string, double>> sizes;  ///< of the whole input: "frames", "cameras"
  int threads = 0;
  std::string less_work = "fewer frames (option 'frames')";      ///< what would make it cheaper still
  std::string better_data = "better calibration or detections";  ///< what would bring a target into reach
  std::vector<SettingTrial> trials;
  std::vector<std::string> reasons;  ///< a sentence for each setting that was chosen among
  SettingChoice choice;
  double trial_s = 0;
  double least_relative_sigma = 0;  ///< of predicted seconds, however well the timings of the parts agree
  double load = std::nan("");       ///< processes that ran on the machine when the trial was over; NaN: not known
  double actual_s = std::nan(""), actual_error = std::nan("");

  const SettingTrial& Chosen() const { return trials[static_cast<size_t>(choice.index)]; }
};

/// Chooses among the trials, which have been timed; `elapsed_s`: since the command began. Throws UsageError where not even the
/// cheapest is within the budget.
void Choose(double elapsed_s, BudgetReport* report);

/// metrics.budget, text, and a warning where the target is out of reach.
CommandResult Describe(const BudgetReport& report);

/// The name of the file of predictions, one JSON object a line, in the output folder.
inline constexpr char kPredictionsFile[] = "predictions.jsonl";
/// Of this machine, as its kernel calls it; may be empty.
std::string ProcessorName();
/// Appends the prediction and its outcome.
void KeepPrediction(const BudgetReport& report, const std::string& folder);

}  // namespace mvstudio::stages
