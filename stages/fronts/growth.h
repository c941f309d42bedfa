#pragma once

#include <cmath>
#include <string>
#include <vector>

/// How a stage's cost and error change as its input grows.
namespace mvstudio::stages {

/// What a stage does without flags, on studios of several sizes that differ in one thing.
struct GrowthRow {
  std::string stage, axis;      ///< "mask"; "cameras", "frames" or "pixels"
  std::vector<double> factors;  ///< 1, 4, 16: of the smallest studio
  std::vector<double> cpu_s;    ///< processor time; as many as factors, as the next two
  std::vector<double> peak_rss_mb, error;
  double exponent = NAN;     ///< of the time, see GrowthExponent
  std::string why_not = {};  ///< larger ones were not measured, or none was
  std::string reason = {};   ///< why the time grows more than in proportion, where it does

  bool WorseThanLinear() const;
};

/// k of start + c n^k through the last three of sizes that each are as many times the one before; of two sizes without a start.
/// NaN where the time grows by less than 0.15 s in all, which is noise, or shrinks on the way.
double GrowthExponent(const std::vector<double>& factors, const std::vector<double>& seconds);

/// The exponent of a row, and its reason where it needs one.
void FinishGrowth(GrowthRow* row);

}  // namespace mvstudio::stages
