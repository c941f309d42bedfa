#pragma once

#include <limits>
#include <string>
#include <vector>

#include "core/status.h"

/// A scene gets the simplest model that data held out of the fit do not show to be worse than the best. Data are counted by
/// independent units: a view, a cluster of views, a stretch of time, a frame. Errors within a unit are correlated, so a unit is
/// one value, and its values under two models are compared in pairs. docs/decisions/0011 lists who chooses by this, and how.
namespace mvstudio {

/// Mean over units; most often of what one model loses against another.
struct UnitMean {
  double mean = 0;            ///< NaN of no unit
  double standard_error = 0;  ///< of the mean; 0 where fewer than two units or an infinite mean leave it open
  int num_units = 0;
};

/// NaN: the unit takes no part.
UnitMean MeanOverUnits(const std::vector<double>& units);

/// Of a - b, unit by unit, over those that both have; 0 where both are infinite.
UnitMean DifferenceOverUnits(const std::vector<double>& a, const std::vector<double>& b);

/// Of a - b, means over independent sets of units.
UnitMean DifferenceOfMeans(const UnitMean& a, const UnitMean& b);

/// mean / standard_error. Without an error: infinity where the mean is positive, else 0.
double InStandardErrors(const UnitMean& difference);

/// When a loss is no worse than the best: the difference is within `standard_errors`; or it is small (`relative`, `absolute`),
/// and not beyond doubt. One standard error: Breiman, Friedman, Olshen and Stone, "Classification and Regression Trees", 1984,
/// chapter 3, there of the best one's loss; of the paired difference it is smaller, and so is the margin.
struct HeldOutRule {
  double standard_errors = 1;
  double relative = 0;  ///< a loss at most so much larger than the best, in parts of it, is small; for losses above 0
  double absolute = 0;  ///< so is a difference up to this
  double beyond_doubt = std::numeric_limits<double>::infinity();  ///< small differences of more standard errors count even so
  int min_units = 2;                                              ///< that both have; fewer show nothing
};

/// `worse_by`: how much more than the best one loses. The losses are for `relative` alone.
bool IsAsGood(const UnitMean& worse_by, const HeldOutRule& rule, double loss = std::numeric_limits<double>::quiet_NaN(),
              double best_loss = std::numeric_limits<double>::quiet_NaN());

struct HeldOutCandidate {
  std::string name;
  std::vector<double> units;  ///< loss in each, the same units in all candidates; NaN: takes no part
  /// By which the best is found, and to which `relative` applies; NaN: the mean of the units, infinite of none.
  double loss = std::numeric_limits<double>::quiet_NaN();
};

/// One candidate against the best.
struct HeldOutVerdict {
  double loss = 0;
  UnitMean worse_by;
  bool as_good = false;
};

struct HeldOutChoice {
  Status status = Status::kOk;           ///< kTooFewViews: too few units, or all losses are infinite; ties are all there is
  int index = 0;                         ///< the first candidate as good as the best
  int best = 0;                          ///< with the smallest loss, of equal ones the first
  std::vector<HeldOutVerdict> verdicts;  ///< one a candidate
  std::string reason;                    ///< one line: why `index`
};

/// Candidates from simple to complex, at least one.
HeldOutChoice ChooseHeldOut(const std::vector<HeldOutCandidate>& candidates, const HeldOutRule& rule);

/// The same line for another one that is as good, where something else decides among these.
std::string HeldOutReason(const std::vector<HeldOutCandidate>& candidates, const HeldOutChoice& choice, int chosen);

/// Mean of the units, infinite of none.
double MeanLoss(const std::vector<double>& units);

}  // namespace mvstudio
