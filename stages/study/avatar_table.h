#pragma once

#include <map>
#include <string>
#include <vector>

#include "report/study/study_tally.h"
#include "stages/study/avatar_scores.h"

/// Comparison table of scored runs: methods x splits.
namespace mvstudio::stages {

/// Spread over the runs of one row.
struct Spread {
  double mean = 0, half_range = 0, sd = 0;  ///< sd: NaN for one run
  double least = 0, most = 0;
  int n = 0;
};
/// For the finite values; NaN where there are none.
Spread SpreadOf(const std::vector<double>& values);

struct SplitScores {
  std::map<std::string, Spread> values;  ///< "ssim", "psnr_db", "mask_iou", "fd", "kid", "lpips" where given, …
  bool same_images = true;               ///< the same images as in the first run
};

/// Result of a user study for a row.
struct StudyCell {
  std::string against;
  double share = 0, low = 0, high = 0, p_value = 0;
  int64_t n = 0, raters = 0;
};

/// What a row's runs cost, by name: "frames_per_s" of rendering, "train_s" (by the clock; without the fit of the body),
/// "num_parameters", "train_rss_mb" and "eval_rss_mb" (peaks of the two commands). Absent where no run tells.
using Costs = std::map<std::string, Spread>;

struct ComparisonRow {
  std::string name, method;
  std::vector<std::string> folders, seeds, cameras;
  std::map<std::string, SplitScores> splits;  ///< by kind, the primary one included
  Costs costs;
  std::vector<StudyCell> study;
  bool baseline = false;
};

/// SSIM of the primary split of a row minus that of the first row.
struct RowDifference {
  std::string row, against;
  double ssim = 0;
  bool spread_known = false;    ///< both rows have several runs
  bool outside_spread = false;  ///< all runs of one are above all runs of the other
};

struct Comparison {
  std::string primary;        ///< kind of the held-out split
  std::string distance_name;  ///< "FID" or "FD (posenet)"
  std::vector<ComparisonRow> rows;
  std::vector<std::string> mixed_splits;  ///< kinds whose images differ between runs
  std::vector<RowDifference> differences;
};

/// Runs with the same label share a row. Without labels, so do runs with the same method, training cameras and options
/// except the seed. Baselines are the mean image, the nearest view and the fitted body without an avatar. Row names contain
/// what distinguishes rows of one method. All runs have one protocol.
Comparison CompareRuns(const std::vector<ScoredRun>& runs, bool baselines);

/// Adds the studies' shares to the rows that their methods name, by the row's name or a run's folder. Returns methods
/// without a row.
std::vector<std::string> AddStudies(const std::vector<report::StudyAnswers>& answers, Comparison* comparison);

std::string TextTable(const Comparison& comparison);
std::string MarkdownTable(const Comparison& comparison);

}  // namespace mvstudio::stages
