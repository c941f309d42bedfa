#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>

#include "calib/check/expected_difference.h"
#include "calib/check/rig_compare.h"
#include "cli/calib/calib.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/some_of.h"
#include "core/units.h"
#include "geometry/rig/alignment.h"
#include "geometry/rig/rig_covariance.h"
#include "stages/input/calib_read.h"

namespace mvstudio::cli {
namespace {

using geometry::Rig;
using geometry::RigCamera;
using nlohmann::ordered_json;

struct Arguments {
  stages::CalibReadOptions read;
  std::string rig, reference, out, ranges = "1,3,inf";
  double max_rotation_deg = 0, max_translation_mm = 0, max_focal_percent = 0, max_lens_px = 0, max_projection_px = 0;
  bool implied = true;
  double focus = 1;
  int grid = 24;
};

/// Keeps the cameras of `rig` that `other` has too; the rest are named in a warning.
CommandResult KeepCommon(const Rig& other, const std::string& path, Rig* rig) {
  CommandResult result;
  std::string missing;
  std::vector<size_t> kept;
  for (size_t c = 0; c < rig->cameras.size(); ++c) {
    const std::string& name = rig->cameras[c].camera.name;
    if (other.Find(name) >= 0)
      kept.push_back(c);
    else
      missing += (missing.empty() ? "" : ", ") + name;
  }
  if (!missing.empty()) {
    result.exit = kExitPartial;
    result.warnings.push_back({"CAL-NOTINBOTH", path + ": left out, not in the other file: " + missing,
                               "rename cameras with calib convert --rename"});
  }
  if (kept.size() < rig->cameras.size()) *rig = geometry::SubsetOf(*rig, kept);
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
CommandResult DescribeDifference(const geometry::RigDifference& difference, bool alone, const Arguments& options) {
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
CommandResult DescribePoses(const Rig& rig, const Rig& reference, const geometry::Rigid3& reference_from_rig) {
  CommandResult result;
  ordered_json& rows = result.metrics["cameras"] = ordered_json::array();
  const auto differences = calib::PoseDifferences(rig, reference, reference_from_rig);
  const auto expected = calib::ExpectedPoseDifferences(rig, reference);
  const bool known = !expected.empty() && std::isfinite(expected[0].rotation_rad);
  result.text += std::string("camera         rotation deg  position mm") +
                 (known ? "  expected deg, mm (both covariances)\n" : "  (no covariances: what to expect is not known)\n");
  for (size_t c = 0; c < differences.size(); ++c) {
    const std::string& name = reference.cameras[c].camera.name;
    const double degrees = RadToDeg(differences[c].rotation_rad), mm = 1e3 * differences[c].translation_m;
    const double expected_deg = RadToDeg(expected[c].rotation_rad), expected_mm = 1e3 * expected[c].translation_m;
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

std::vector<double> ParseMetres(const std::string& text) {
  std::vector<double> ranges;
  for (size_t start = 0; start <= text.size();) {
    const size_t end = std::min(text.find(',', start), text.size());
    double range = 0;
    const auto [stop, code] = std::from_chars(text.data() + start, text.data() + end, range);
    if (code != std::errc() || stop != text.data() + end || !(range > 0)) {
      throw UsageError("--range-m " + text + ": expected distances in metres such as 1,3,inf");
    }
    ranges.push_back(range);
    start = end + 1;
  }
  return ranges;
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

ordered_json DiffJson(const calib::ProjectionDiff& diff, const std::vector<double>& expected_px, const std::string& name) {
  ordered_json json{{"name", name}, {"status", std::string(ToString(diff.status))}};
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
                              {"expected_rms_px", FiniteOrNull(expected_px[r])},
                              {"times", TimesJson(at.rms_px, expected_px[r])},
                              {"max_px", FiniteOrNull(at.max_px)},
                              {"centre_px", FiniteOrNull(at.centre_px)},
                              {"num_points", at.num_points},
                              {"grid_px", GridJson(at.grid_px)}});
  }
  return json;
}

/// A line of what the implied motion takes out, then one a range.
std::string DiffText(const calib::ProjectionDiff& diff, const std::vector<double>& expected_px, const std::string& name) {
  if (diff.ranges.empty()) return Format("%-14s image sizes differ\n", name.c_str());
  std::string text =
      Format("%-14s implied %.4f deg, %.3f mm\n", name.c_str(), RadToDeg(diff.rotation_rad), 1e3 * diff.translation_m);
  for (size_t r = 0; r < diff.ranges.size(); ++r) {
    const calib::ProjectionDiffAtRange& at = diff.ranges[r];
    text += Format("  at %g m: ", at.range_m) +
            (at.num_points == 0 ? std::string("no point is seen through both lenses\n")
                                : Format("rms %.3f max %.3f centre %.3f px", at.rms_px, at.max_px, at.centre_px) +
                                      TimesText(at.rms_px, expected_px[r]) + "\n");
  }
  return text;
}

CommandResult CompareProjections(const Rig& rig, const Rig& reference, const Arguments& arguments) {
  CommandResult result;
  calib::ProjectionDiffOptions options;
  options.ranges_m = ParseMetres(arguments.ranges);
  options.implied = arguments.implied;
  options.focus = arguments.focus;
  options.grid_cols = arguments.grid;
  double worst = 0;
  std::vector<std::string> uncompared;
  result.text += arguments.implied
                     ? "projection by the lenses alone, with the motion of each camera that explains most of it taken out:\n"
                     : "projection by the lenses alone:\n";
  auto& list = result.metrics["projection"] = ordered_json::array();
  for (const RigCamera& camera : reference.cameras) {
    const std::string& name = camera.camera.name;
    const RigCamera& other = rig.cameras[static_cast<size_t>(rig.Find(name))];
    const calib::ProjectionDiff diff = calib::CompareProjection(other.camera, camera.camera, options);
    const std::vector<double> expected_px = calib::ExpectedProjectionRms(other, camera, options);
    list.push_back(DiffJson(diff, expected_px, name));
    result.text += DiffText(diff, expected_px, name);
    if (diff.status != Status::kOk) {
      uncompared.push_back(name);
      result.warnings.push_back({"CAL-NOTCOMPARED",
                                 "camera " + name + ": the two lenses cannot be compared: " +
                                     (diff.ranges.empty() ? "the image sizes differ" : "no point is seen through both"),
                                 ""});
    }
    for (const auto& at : diff.ranges) worst = std::max(worst, at.rms_px);
  }
  const bool none = uncompared.size() == reference.cameras.size();
  result.metrics["max_projection_rms_px"] = none ? ordered_json(nullptr) : ordered_json(worst);
  if (none) {
    result.exit = kExitQualityGate;
    result.errors.push_back(
        {"CAL-NOTCOMPARED", "the lenses of no camera can be compared", "give two files of the same image sizes"});
  }
  result.partial = !uncompared.empty();
  if (arguments.max_projection_px > 0 && worst > arguments.max_projection_px)
    result.Add(Failing(Format("projection differs by %.6g px (rms), allowed %.6g", worst, arguments.max_projection_px)));
  else if (arguments.max_projection_px > 0 && !uncompared.empty())
    result.Add(Failing("the projection cannot be checked of " + Join(uncompared, ", ")));
  return result;
}

/// The rigid motion leaves one or two cameras or coincident ones alone: said, and the lenses are compared all the same.
CommandResult ComparePoses(const Rig& rig, const Rig& reference, const Arguments& arguments) {
  const geometry::RigDifference difference = geometry::CompareRigs(rig, reference);
  CommandResult result;
  result.metrics["status"] = std::string(ToString(difference.status));
  if (difference.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"CAL-NOTALIGNED", "the rigs cannot be aligned: " + std::string(ToString(difference.status)), ""});
    return result;
  }
  const bool alone = rig.cameras.size() == 1;
  result.Add(DescribeDifference(difference, alone, arguments));
  if (alone) return result;
  result.Add(DescribePoses(rig, reference, difference.reference_from_rig));
  result.text += std::to_string(rig.cameras.size()) + " cameras, after the best rigid alignment\n";
  return result;
}

/// metrics.differing: the cameras with a figure that is significant, and a sentence; nothing where no covariance says it.
CommandResult DescribeSignificance(const ordered_json& metrics) {
  std::map<std::string, double> most;  // by camera
  const auto count = [&](const ordered_json& name, const ordered_json& times) {
    if (times.is_number()) most[name] = std::max(most[name], times.get<double>());
  };
  for (const ordered_json& row : metrics.value("cameras", ordered_json::array()))
    count(row["name"], row["rotation_times"]), count(row["name"], row["translation_times"]);
  for (const ordered_json& row : metrics["projection"]) {
    for (const ordered_json& at : row["ranges"]) count(row["name"], at["times"]);
  }
  CommandResult result;
  std::vector<std::string> differing;
  ordered_json& names = result.metrics["differing"] = ordered_json::array();
  for (const auto& [name, times] : most) {
    if (times > kSignificant) names.push_back(name), differing.push_back(name + Format(" (%.1f times)", times));
  }
  if (!most.empty())
    result.text =
        differing.empty()
            ? Format("no camera differs by more than %g times what both covariances let expect: no sign of a change\n",
                     kSignificant)
            : "more than both covariances let expect: " + SomeOf(differing) + "\n";
  return result;
}

CommandResult Compare(const Arguments& arguments) {
  calib::ImportedRig rig = stages::ReadCalibrationFiles({arguments.rig}, arguments.read);
  calib::ImportedRig reference = stages::ReadCalibrationFiles({arguments.reference}, arguments.read);
  CommandResult result;
  result.inputs = {arguments.rig, arguments.reference};
  std::optional<OutputFolder> place;
  if (!arguments.out.empty())
    place.emplace(arguments.out, result.inputs, std::vector<std::string>{"calib_compare.result.json"});
  result.folder = arguments.out;
  stages::AddNotes(rig.notes, &result);
  stages::AddNotes(reference.notes, &result);
  if (rig.rig.cameras.size() == 1 && reference.rig.cameras.size() == 1) {
    rig.rig.cameras[0].camera.name = reference.rig.cameras[0].camera.name;  // whatever their names: nothing else can be meant
  }
  const std::vector<std::string> rig_names = geometry::CameraNames(rig.rig),
                                 reference_names = geometry::CameraNames(reference.rig);
  result.Add(KeepCommon(reference.rig, arguments.rig, &rig.rig));
  result.Add(KeepCommon(rig.rig, arguments.reference, &reference.rig));
  if (rig.rig.cameras.empty())
    throw UsageError(arguments.rig + " and " + arguments.reference + ": no camera name is in both (" + SomeOf(rig_names) +
                     " beside " + SomeOf(reference_names) + "); give them one name: calib convert --rename OLD=NEW");
  result.metrics["num_cameras"] = rig.rig.cameras.size();
  result.Add(ComparePoses(rig.rig, reference.rig, arguments));
  if (!result.errors.empty()) return result;
  result.Add(CompareProjections(rig.rig, reference.rig, arguments));
  result.Add(DescribeSignificance(result.metrics));
  return result;
}

void AddLimits(CLI::App* sub, Arguments& arguments) {
  AddOption(sub, "--max-rotation-deg", arguments.max_rotation_deg, "exit 4 when a camera differs more; 0: no limit")
      ->capture_default_str();
  AddOption(sub, "--max-translation-mm", arguments.max_translation_mm, "exit 4 when a camera differs more; 0: no limit")
      ->capture_default_str();
  AddOption(sub, "--max-focal-percent", arguments.max_focal_percent, "exit 4 when a focal length differs more; 0: no limit")
      ->capture_default_str();
  AddOption(sub, "--max-lens-px", arguments.max_lens_px,
            "exit 4 when a ray's pixels through both lenses lie farther apart; 0: no limit")
      ->capture_default_str();
  AddOption(sub, "--max-projection-px", arguments.max_projection_px,
            "exit 4 when the projection difference (rms over the image, any range) is larger; 0: no limit")
      ->capture_default_str();
}

}  // namespace

void RegisterCalibCompare(CLI::App& calib, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = calib.add_subcommand("compare",
                                       "Difference of two calibrations: poses after the rigid motion that aligns them "
                                       "best, and projection in px");
  AddOption(sub, "A", arguments->rig, "calibration")->required();
  AddOption(sub, "B", arguments->reference, "reference calibration")->required();
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder, "folder that keeps the comparison, for mvstudio report");
  AddOption(sub, "--range-m", arguments->ranges, "distances at which projections are compared, metres, with commas")
      ->capture_default_str();
  AddFlag(sub, "--implied,!--no-implied", arguments->implied,
          "take out the small motion between the two camera frames that explains most of the projection difference")
      ->capture_default_str();
  AddOption(sub, "--focus", arguments->focus,
            "share of the image's half diagonal, around its centre, in which that motion is fitted")
      ->capture_default_str()
      ->check(CLI::Range(0.01, 1.0));
  AddOption(sub, "--grid", arguments->grid, "points across the image at which projections are compared")
      ->capture_default_str()
      ->check(CLI::Range(2, 1000));
  AddLimits(sub, *arguments);
  AddReadOptions(sub, arguments->read);
  registry.Add(sub, "calib compare", [arguments](CommandContext&) { return Compare(*arguments); });
}

}  // namespace mvstudio::cli
