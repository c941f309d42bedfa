#include "stages/compare/describe.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/format.h"
#include "core/join.h"
#include "core/some_of.h"
#include "core/units.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

CommandResult DescribeUnmatched(const std::vector<std::string>& cameras, const std::string& path) {
  CommandResult result;
  if (cameras.empty()) return result;
  result.exit = kExitPartial;
  result.warnings.push_back({"CAL-NOTINBOTH", path + ": left out, not in the other file: " + Join(cameras, ", "),
                             "rename cameras with calib convert option 'rename'"});
  return result;
}

/// Beyond this, errors that both covariances state make a difference in one case of twenty at most.
constexpr double kSignificant = 2;

/// "3.1 times what both covariances let expect", or why that is not known.
std::string TimesText(double value, double expected) {
  if (!std::isfinite(expected)) return "";
  if (!(expected > 0)) return value > 0 ? "  (no uncertainty is stated)" : "";
  const double times = value / expected;
  return Format("  %.3g expected: %.1f times%s", expected, times, times > kSignificant ? ", a change" : "");
}

ordered_json TimesJson(double value, double expected) {
  return expected > 0 && std::isfinite(expected) ? FiniteOrNull(value / expected) : ordered_json(nullptr);
}

CommandResult Failing(const std::string& text) {
  CommandResult result;
  result.exit = kExitQualityGate;
  result.warnings.push_back({"CAL-DIFFERS", text, ""});
  return result;
}

/// Of one camera alone the alignment is its pose, so that nothing is left of it to compare.
CommandResult DescribeDifference(const geometry::RigDifference& difference, bool alone, const CompareOptions& options) {
  CommandResult result;
  struct Row {
    const char* key;
    double value, mean, limit;
    const char* unit;
  };
  const auto of_pose = [alone](double value) { return alone ? std::nan("") : value; };
  const Row rows[] = {{"rotation_deg", of_pose(RadToDeg(difference.max_rotation_rad)),
                       of_pose(RadToDeg(difference.mean_rotation_rad)), options.max_rotation_deg, "deg"},
                      {"translation_mm", of_pose(1e3 * difference.max_translation_m),
                       of_pose(1e3 * difference.mean_translation_m), options.max_translation_mm, "mm"},
                      {"focal_percent", 100 * difference.max_focal_relative, -1, options.max_focal_percent, "%"},
                      {"lens_px", difference.max_lens_px, -1, options.max_lens_px, "px"}};
  for (const Row& row : rows) {
    result.metrics[std::string("max_") + row.key] = FiniteOrNull(row.value);
    if (!(row.mean < 0)) result.metrics[std::string("mean_") + row.key] = FiniteOrNull(row.mean);
    result.text += (std::isfinite(row.value) ? Format("%-15s max %.6g %s", row.key, row.value, row.unit)
                    : std::isnan(row.value)  ? Format("%-15s not comparable: one camera alone is in both", row.key)
                                             : Format("%-15s somewhere in the image one lens alone sees", row.key)) +
                   (row.mean >= 0 ? Format(", mean %.6g %s", row.mean, row.unit) : "") + "\n";
    if (row.limit > 0 && std::isnan(row.value))
      result.Add(Failing(Format("%s cannot be checked: one camera alone is in both", row.key)));
    else if (row.limit > 0 && row.value > row.limit)
      result.Add(Failing(Format("%s is %.6g, allowed %.6g", row.key, row.value, row.limit)));
  }
  return result;
}

/// metrics.cameras and a table: what is left of each camera's pose after the alignment.
CommandResult DescribePoses(const CompareReport& report) {
  CommandResult result;
  ordered_json& rows = result.metrics["cameras"] = ordered_json::array();
  const bool known = !report.expected_poses.empty() && std::isfinite(report.expected_poses[0].rotation_rad);
  result.text = std::string("camera         rotation deg  position mm") +
                (known ? "  expected deg, mm (both covariances)\n" : "  (no covariances: what to expect is not known)\n");
  for (size_t c = 0; c < report.poses.size(); ++c) {
    const calib::PoseDifference &pose = report.poses[c], &expected = report.expected_poses[c];
    const std::string& name = report.cameras[c];
    const double degrees = RadToDeg(pose.rotation_rad), mm = 1e3 * pose.translation_m;
    const double expected_deg = RadToDeg(expected.rotation_rad), expected_mm = 1e3 * expected.translation_m;
    rows.push_back({{"name", name},
                    {"rotation_deg", FiniteOrNull(degrees)},
                    {"translation_mm", FiniteOrNull(mm)},
                    {"expected_rotation_deg", FiniteOrNull(expected_deg)},
                    {"expected_translation_mm", FiniteOrNull(expected_mm)},
                    {"rotation_times", TimesJson(degrees, expected_deg)},
                    {"translation_times", TimesJson(mm, expected_mm)}});
    result.text += Format("%-14s %12.4f  %11.3f", name.c_str(), degrees, mm);
    if (known) result.text += Format("  %12.4f  %.3f", expected_deg, expected_mm);
    const bool changed = degrees > kSignificant * expected_deg || mm > kSignificant * expected_mm;
    result.text += known && changed ? "  a change\n" : "\n";
  }
  return result;
}

ordered_json GridJson(const Eigen::MatrixXd& grid) {
  ordered_json rows = ordered_json::array();
  for (Eigen::Index r = 0; r < grid.rows(); ++r) {
    ordered_json row = ordered_json::array();
    for (Eigen::Index c = 0; c < grid.cols(); ++c) row.push_back(FiniteOrNull(std::round(1e4 * grid(r, c)) / 1e4));
    rows.push_back(row);
  }
  return rows;
}

ordered_json AxisJson(const Eigen::RowVectorXd& axis) {
  ordered_json json = ordered_json::array();
  for (Eigen::Index i = 0; i < axis.size() && std::isfinite(axis[i]); ++i) json.push_back(axis[i]);
  return json;
}

ordered_json LensesJson(const ComparedLenses& lenses) {
  const calib::ProjectionDiff& diff = lenses.diff;
  ordered_json json{{"name", lenses.camera}, {"status", std::string(ToString(diff.status))}};
  json["implied_rotation_deg"] = RadToDeg(diff.rotation_rad);
  json["implied_translation_mm"] = 1e3 * diff.translation_m;
  if (!diff.ranges.empty()) {
    json["grid_u_px"] = AxisJson(diff.grid_axes_px.row(0));
    json["grid_v_px"] = AxisJson(diff.grid_axes_px.row(1));
  }
  json["ranges"] = ordered_json::array();
  for (size_t r = 0; r < diff.ranges.size(); ++r) {
    const calib::ProjectionDiffAtRange& at = diff.ranges[r];
    json["ranges"].push_back({{"range_m", FiniteOrNull(at.range_m)},
                              {"rms_px", FiniteOrNull(at.rms_px)},
                              {"expected_rms_px", FiniteOrNull(lenses.expected_px[r])},
                              {"times", TimesJson(at.rms_px, lenses.expected_px[r])},
                              {"max_px", FiniteOrNull(at.max_px)},
                              {"centre_px", FiniteOrNull(at.centre_px)},
                              {"num_points", at.num_points},
                              {"grid_px", GridJson(at.grid_px)}});
  }
  return json;
}

/// A line of what the implied motion takes out, then one a range.
std::string LensesText(const ComparedLenses& lenses) {
  const calib::ProjectionDiff& diff = lenses.diff;
  const std::string& name = lenses.camera;
  if (diff.ranges.empty()) return Format("%-14s image sizes differ\n", name.c_str());
  std::string text =
      Format("%-14s implied %.4f deg, %.3f mm\n", name.c_str(), RadToDeg(diff.rotation_rad), 1e3 * diff.translation_m);
  for (size_t r = 0; r < diff.ranges.size(); ++r) {
    const calib::ProjectionDiffAtRange& at = diff.ranges[r];
    text += Format("  at %g m: ", at.range_m) +
            (at.num_points == 0 ? std::string("no point is seen through both lenses\n")
                                : Format("rms %.3f max %.3f centre %.3f px", at.rms_px, at.max_px, at.centre_px) +
                                      TimesText(at.rms_px, lenses.expected_px[r]) + "\n");
  }
  return text;
}

CommandResult DescribeProjections(const CompareReport& report) {
  CommandResult result;
  double worst = 0;
  std::vector<std::string> uncompared;
  result.text = report.options.implied
                    ? "projection by the lenses alone, with the motion of each camera that explains most of it taken out:\n"
                    : "projection by the lenses alone:\n";
  auto& list = result.metrics["projection"] = ordered_json::array();
  for (const ComparedLenses& lenses : report.lenses) {
    list.push_back(LensesJson(lenses));
    result.text += LensesText(lenses);
    for (const auto& at : lenses.diff.ranges) worst = std::max(worst, at.rms_px);
    if (lenses.diff.status == Status::kOk) continue;
    uncompared.push_back(lenses.camera);
    result.warnings.push_back({"CAL-NOTCOMPARED",
                               "camera " + lenses.camera + ": the two lenses cannot be compared: " +
                                   (lenses.diff.ranges.empty() ? "the image sizes differ" : "no point is seen through both"),
                               ""});
  }
  const bool none = uncompared.size() == report.lenses.size();
  result.metrics["max_projection_rms_px"] = none ? ordered_json(nullptr) : ordered_json(worst);
  if (none) {
    result.exit = kExitQualityGate;
    result.errors.push_back(
        {"CAL-NOTCOMPARED", "the lenses of no camera can be compared", "give two files of the same image sizes"});
  }
  result.partial = !uncompared.empty();
  const double limit_px = report.options.max_projection_px;
  if (limit_px > 0 && worst > limit_px)
    result.Add(Failing(Format("projection differs by %.6g px (rms), allowed %.6g", worst, limit_px)));
  else if (limit_px > 0 && !uncompared.empty())
    result.Add(Failing("the projection cannot be checked of " + Join(uncompared, ", ")));
  return result;
}

/// metrics.differing: the cameras with a figure that is significant, and a sentence; nothing where no covariance says it.
CommandResult DescribeSignificance(const CompareReport& report) {
  std::map<std::string, double> most;  // by camera
  const auto count = [&](const std::string& camera, double value, double expected) {
    if (expected > 0 && std::isfinite(expected)) most[camera] = std::max(most[camera], value / expected);
  };
  for (size_t c = 0; c < report.poses.size(); ++c) {
    count(report.cameras[c], report.poses[c].rotation_rad, report.expected_poses[c].rotation_rad);
    count(report.cameras[c], report.poses[c].translation_m, report.expected_poses[c].translation_m);
  }
  for (const ComparedLenses& lenses : report.lenses)
    for (size_t r = 0; r < lenses.diff.ranges.size(); ++r)
      count(lenses.camera, lenses.diff.ranges[r].rms_px, lenses.expected_px[r]);
  CommandResult result;
  std::vector<std::string> differing;
  ordered_json& names = result.metrics["differing"] = ordered_json::array();
  for (const auto& [name, times] : most) {
    if (times > kSignificant) names.push_back(name), differing.push_back(name + Format(" (%.1f times)", times));
  }
  if (most.empty()) return result;
  result.text = differing.empty()
                    ? Format("no camera differs by more than %g times what both covariances let expect: no sign of a change\n",
                             kSignificant)
                    : "more than both covariances let expect: " + SomeOf(differing) + "\n";
  return result;
}

/// The rigid motion leaves one or two cameras or coincident ones alone: said, and the lenses are compared all the same.
CommandResult DescribeCompared(const CompareReport& report) {
  CommandResult result;
  const Status status = report.difference.status;
  result.metrics["status"] = std::string(ToString(status));
  if (status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"CAL-NOTALIGNED", "the rigs cannot be aligned: " + std::string(ToString(status)), ""});
    return result;
  }
  result.Add(DescribeDifference(report.difference, report.IsAlone(), report.options));
  if (!report.IsAlone()) {
    result.Add(DescribePoses(report));
    result.text += std::to_string(report.cameras.size()) + " cameras, after the best rigid alignment\n";
  }
  result.Add(DescribeProjections(report));
  result.Add(DescribeSignificance(report));
  return result;
}

}  // namespace

CommandResult Describe(const CompareReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  result.folder = report.options.out;
  result.Add(DescribeUnmatched(report.only_in_rig, report.options.rig));
  result.Add(DescribeUnmatched(report.only_in_reference, report.options.reference));
  result.metrics["num_cameras"] = report.cameras.size();
  result.Add(DescribeCompared(report));
  return result;
}

}  // namespace mvstudio::stages
