#pragma once

#include <Eigen/Core>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/status.h"

/// Known lengths that give a rig its size.
namespace mvstudio::calib {

/// A distance of two named points that stays the same; or a person's height, where `from` is kHeightOfPerson and `to` empty.
struct StatedLength {
  std::string from, to;
  double length_m = 0;
  double sigma_m = 0;  ///< standard deviation; 0: not stated, the length counts as exact

  bool IsHeight() const { return to.empty(); }
  std::string Name() const { return IsHeight() ? from : from + ":" + to; }
};

inline constexpr char kHeightOfPerson[] = "Height";

/// "A:B:1.75m", "A:B:380mm:2mm" with its standard deviation, or "Height:1.75m"; units m, cm, mm, in. Throws UsageError.
StatedLength ParseStatedLength(const std::string& text);
std::vector<StatedLength> ParseStatedLengths(const std::vector<std::string>& texts);

/// Lengths between named points. A person's height becomes thighs, shanks, upper arms and forearms as shares of it, each
/// right to 7 % (Drillis and Contini, "Body Segment Parameters", 1966, give means). `names`: of the points. Throws UsageError
/// for a point that is not among them, and for a height where no such segment is.
std::vector<StatedLength> LengthsOf(const std::vector<StatedLength>& stated, const std::vector<std::string>& names);

/// Points of one moment and one person, metres in world.
using NamedPoints = std::map<std::string, Eigen::Vector3d>;

struct LengthScale {
  struct Row {
    StatedLength length;
    int num_moments = 0;                                       ///< that hold both points
    double measured_m = 0;                                     ///< median over them
    double spread = std::numeric_limits<double>::quiet_NaN();  ///< relative; standard deviation of the middle half, as of a
                                                               ///< normal variable; NaN: fewer than three moments
    double scale = 1;                                          ///< stated over measured
    double sigma = std::numeric_limits<double>::quiet_NaN();   ///< of `scale`, relative; NaN: one moment, nothing stated
  };
  Status status = Status::kOk;  ///< kTooFewViews: two points are never together; kDegenerate: they coincide
  std::string message;          ///< one line when the status is not kOk
  double scale = 1;             ///< by which all lengths are multiplied
  double sigma = std::numeric_limits<double>::quiet_NaN();  ///< relative; NaN: unknown
  double disagreement = 0;  ///< largest deviation of a row from `scale`, in standard deviations; 0 of a single length
  size_t worst = 0;         ///< its row
  std::vector<Row> rows;
};

/// The scale that lengths ask for: their mean, weighted by the errors that are stated and by the scatter over time. Errors of
/// neighbouring moments are alike, so the median's error is that of ten stretches of time. Where lengths disagree, the
/// deviation grows by the root of chi squared per degree of freedom. `moments` are in order of time.
LengthScale ScaleFromLengths(const std::vector<StatedLength>& lengths, const std::vector<NamedPoints>& moments);

}  // namespace mvstudio::calib
