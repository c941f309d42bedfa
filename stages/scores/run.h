#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/progress.h"
#include "stages/input/image_file_pairs.h"
#include "stages/scores/options.h"

namespace mvstudio::stages {

struct DistanceResult {
  double fd = 0, floor = 0, kid = 0, kid_se = 0;  ///< floor, kid: NaN where a set is known by its mean and covariance alone
  int64_t n_a = 0, n_b = 0, d = 0;                ///< n: 0 where it is not known
  std::string features;
  std::string name;  ///< "FID" or "FD (features)"
};

struct WrittenStatistics {
  int64_t n = 0, d = 0;
  std::string features;
};

struct ScoresReport {
  ScoresOptions options;
  ImageFilePairs pairs;                    ///< none: of sets without pairs, and of one set
  std::optional<DistanceResult> distance;  ///< between the sets
  std::string why_no_distance;             ///< of pairs; empty in builds without libtorch, too
  std::string lone_reference, lone_other;  ///< an image of each of two sets that have no name in common
  std::optional<WrittenStatistics> statistics;
};

/// Throws UsageError without a second set.
void RequireTwoSets(const ScoresOptions& options);

/// Similarity of images of the same names. Needs no libtorch. Throws UsageError, IoError and FormatError.
ScoresReport RunPairScores(const ScoresOptions& options, const RunContext& run = {});

}  // namespace mvstudio::stages
