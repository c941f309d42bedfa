#include "stages/calib/stated_lengths.h"

#include <cmath>

#include "core/format.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

constexpr double kDisagree = 3;       // standard deviations
constexpr double kFactorOfAUnit = 9;  // a rig that is larger or smaller by more has another unit

ordered_json JsonOfRow(const calib::LengthScale::Row& row) {
  return {{"length", row.length.Name()},
          {"stated_mm", 1e3 * row.length.length_m},
          {"sigma_mm", row.length.sigma_m > 0 ? ordered_json(1e3 * row.length.sigma_m) : ordered_json(nullptr)},
          {"measured_mm", FiniteOrNull(1e3 * row.measured_m)},
          {"num_frames", row.num_moments},
          {"spread_percent", FiniteOrNull(100 * row.spread)},
          {"scale", FiniteOrNull(row.scale)}};
}

std::string LineOfRow(const calib::LengthScale::Row& row) {
  std::string line =
      Format("%-24s %s, measured %s in %d %s", row.length.Name().c_str(), LengthText(row.length.length_m).c_str(),
             LengthText(row.measured_m).c_str(), row.num_moments, row.num_moments == 1 ? "frame" : "frames");
  if (std::isfinite(row.spread)) line += Format(" +- %.2f %%", 100 * row.spread);
  return line + Format(": scale %.5f\n", row.scale);
}

}  // namespace

CommandResult DescribeLengths(const calib::LengthScale& scale) {
  CommandResult result;
  if (scale.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.metrics["status"] = std::string(ToString(scale.status));
    result.errors.push_back({"CAL-LENGTH", scale.message, "name two points that are seen together"});
    return result;
  }
  result.metrics["scale"] = scale.scale;
  result.metrics["scale_sigma"] = FiniteOrNull(scale.sigma * scale.scale);
  ordered_json& rows = result.metrics["lengths"] = ordered_json::array();
  for (const calib::LengthScale::Row& row : scale.rows) rows.push_back(JsonOfRow(row)), result.text += LineOfRow(row);
  result.text += Format("scale %.5f", scale.scale);
  if (std::isfinite(scale.sigma)) result.text += Format(" +- %.5f", scale.sigma * scale.scale);
  result.text += "\n";
  if (scale.disagreement > kDisagree) {
    const calib::LengthScale::Row& worst = scale.rows[scale.worst];
    result.warnings.push_back({"CAL-LENGTH",
                               Format("the lengths disagree: %s asks for a scale of %.4f, together they give %.4f",
                                      worst.length.Name().c_str(), worst.scale, scale.scale),
                               "measure it again, or state the standard deviation of each length"});
  }
  if (scale.scale > kFactorOfAUnit || scale.scale < 1 / kFactorOfAUnit)
    result.warnings.push_back(
        {"CAL-SCALE", Format("the rig becomes %.4g times as large", scale.scale), "check the length and its unit"});
  return result;
}

}  // namespace mvstudio::stages
