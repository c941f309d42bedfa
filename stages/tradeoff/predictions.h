#pragma once

#include <string>
#include <vector>

#include "stages/result.h"

/// What budgets promised in earlier runs, beside what came of it.
namespace mvstudio::stages {

struct PredictionsOptions {
  std::vector<std::string> files;  ///< predictions.jsonl, or folders that are searched for them
  std::string out;                 ///< folder of the page; empty: none
};

struct KeptPrediction {
  std::string stage, path, settings, processor, error_unit;
  double frames = 0, threads = 0, load = 0;
  double predicted_s = 0, actual_s = 0, predicted_error = 0, actual_error = 0;  ///< NaN: unknown
  double trial_s = 0;                                                           ///< of actual_s
};

/// Actual over predicted, over the runs that have both.
struct RatioFigures {
  int num = 0, num_within = 0;   ///< within 15 % of the time, 20 % of the error
  double median = 0, worst = 0;  ///< the worst is the farthest from 1, as a factor; NaN of none
};

struct StagePredictions {
  std::string stage;
  RatioFigures seconds, error;
  double trial_share = 0;  ///< of the time that runs took, median; NaN: unknown
};

struct PredictionsReport {
  PredictionsOptions options;
  InputNotes notes;
  std::vector<KeptPrediction> predictions;
  std::vector<StagePredictions> stages;  ///< by name
  std::string page;                      ///< that was written; empty: none
};

/// Of the ratios actual / predicted that are above 0 and finite.
RatioFigures FiguresOfRatios(const std::vector<double>& ratios, double band);

/// Throws UsageError where there is no file; FormatError with the line of one that is no prediction.
PredictionsReport RunPredictions(const PredictionsOptions& options);
CommandResult Describe(const PredictionsReport& report);

}  // namespace mvstudio::stages
