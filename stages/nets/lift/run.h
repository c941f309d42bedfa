#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "stages/nets/lift/options.h"

namespace mvstudio::stages {

/// How a lifter does on held-out frames.
struct LiftHeldOut {
  avatar::LiftComparison all;
  std::vector<avatar::LiftComparison> per_dataset;  ///< where there are several
};

struct LiftTrainReport {
  std::vector<std::string> datasets;
  std::string out;
  int people = 0, frames = 0;  ///< learned from
  double size_m = 0;           ///< mean size of those people
  avatar::LiftReport training;
  std::optional<LiftHeldOut> holdout;
};

/// Trains a lifter and writes it. Throws UsageError, IoError, and FormatError where nobody is seen.
LiftTrainReport RunLiftTrain(const LiftTrainOptions& options, const RunContext& run = {});

struct LiftApplyReport {
  InputNotes notes;
  std::string folder;
  std::map<int, avatar::LiftedFrame> frames;
  double size_m = 0, rate_hz = 0;  ///< rate: 0: unknown
  std::optional<avatar::LiftScore> truth;
};

/// Lifts a take and writes its joints as triangulate does. Throws UsageError, IoError and FormatError; frames that cannot be
/// lifted say why in their status.
LiftApplyReport RunLiftApply(const LiftApplyOptions& options);

}  // namespace mvstudio::stages
