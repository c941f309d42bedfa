#include "stages/scores/run.h"

#include "core/error.h"

namespace mvstudio::stages {

void RequireTwoSets(const ScoresOptions& options) {
  if (options.other.empty() && options.write_statistics.empty())
    throw UsageError("metrics compares two sets: give a second one, or option 'write-statistics' FILE for one");
}

ScoresReport RunPairScores(const ScoresOptions& options, const RunContext& run) {
  RequireTwoSets(options);
  ScoresReport report;
  report.options = options;
  ImageFilePairs& pairs = report.pairs;
  pairs = PairImages(options.reference, options.other, options.masks);
  pairs.backdrop = options.background == "auto" ? BackdropOf(pairs.pairs) : BackdropOf(options.background);
  ScorePairs(&pairs, run);
  return report;
}

}  // namespace mvstudio::stages
