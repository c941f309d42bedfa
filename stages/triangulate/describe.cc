#include "stages/triangulate/describe.h"

#include <cmath>
#include <filesystem>

#include "core/format.h"
#include "core/some_of.h"
#include "stages/older_kept.h"
#include "stages/people/likely_cause.h"
#include "stages/triangulate/describe_parts.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

ordered_json ProjectUseJson(const ProjectUse& use) {
  ordered_json json = ProjectJson(use.input);
  for (const auto& [option, value] : use.settings) json["settings"][option] = value;
  if (!use.world.empty()) json["world"] = use.world;
  return json;
}

std::string ProjectText(const ProjectUse& use) {
  std::string text, settings;
  for (const std::string& note : use.input.notes) text += "project: " + note + "\n";
  for (const auto& [option, value] : use.settings) settings += " option '" + option + "' " + value;
  return settings.empty() ? text : text + "of the project's configuration:" + settings + "\n";
}

/// What the project asked to be written.
CommandResult DescribeProjectFiles(const ProjectUse& use) {
  CommandResult result;
  if (!use.calibration.empty()) {
    result.outputs.push_back({use.calibration, ""});
    result.text =
        "points are in the world " + use.world.substr(use.world.find(": ") + 2) + "; calibration.json is in it, too\n";
  }
  if (!use.angles.empty()) result.outputs.push_back({use.angles, "angles"});
  return result;
}

std::string LeftOutText(const triangulate::LeftOutFigures& holdout) {
  if (holdout.num_samples == 0) return "cannot be measured, no joint is seen by three cameras";
  if (std::isfinite(holdout.median_px)) return Format("median %.2f px", holdout.median_px);
  return Format("the others predict %.0f %% of its detections", 100 * holdout.coverage);
}

/// A line that begins with its line break. `what` says which points were compared; empty where there are only these.
std::string ComparisonText(const std::string& key, const std::string& what, const TruthComparison& truth) {
  const dataset::Pose3dComparison& found = truth.comparison;
  if (found.num == 0) return "\nagainst " + key + what + ": nothing could be compared, " + found.why_none;
  std::string text =
      Format("\nagainst %s%s: median %s, p95 %s, %d joints", key.c_str(), what.c_str(),
             LengthText(found.median_mm / 1e3).c_str(), LengthText(found.p95_mm / 1e3).c_str(), static_cast<int>(found.num));
  if (!truth.unit.empty()) text += Format(" (its unit %s, %s up)", truth.unit.c_str(), truth.up.c_str());
  if (!found.without_counterpart.empty()) text += "; not compared, by their names: " + SomeOf(found.without_counterpart);
  if (found.persons_left_out > 0)
    text += Format("; %d other person(s) have no counterpart in it", static_cast<int>(found.persons_left_out));
  return text;
}

std::string SummaryOf(const TriangulateReport& report) {
  const PointFigures& points = report.points;
  std::string text = Format("%d of %d joints triangulated", points.num_points, points.num_tried);
  if (points.num_points > 0)
    text += Format(", reprojection RMS median %.3f px, sigma %.3f px, median sigma %s, %.0f points/s", points.median_rms_px,
                   report.take.sigma_px > 0 ? report.take.sigma_px : std::nan(""),
                   LengthText(points.median_sigma_mm / 1e3).c_str(), points.points_per_s);
  text += Format("\nmethod %s; one camera left out: ", std::string(ToString(report.take.method)).c_str()) +
          LeftOutText(report.take.holdout.all);
  if (std::isfinite(points.limb_std_mm)) text += "; bone lengths vary by " + LengthText(points.limb_std_mm / 1e3);
  for (const ReferenceComparison& comparison : report.comparisons)
    text += ComparisonText(comparison.option, "", comparison.points);
  return text + "\n";
}

CommandResult DescribeComparison(const ReferenceComparison& comparison) {
  CommandResult result;
  const TruthComparison& found = comparison.points;
  ordered_json& json = result.metrics[comparison.option] = ComparisonToJson(found);
  if (comparison.written) json["written"] = ComparisonToJson(*comparison.written);
  result.inputs.push_back(comparison.path);
  if (found.comparison.num == 0) {
    result.exit = kExitQualityGate;
    result.errors.push_back(NothingInCommon(comparison.option, comparison.path, found.comparison.why_none));
  }
  for (const std::string& note : found.notes)
    result.warnings.push_back({"TRI-MARKER-FILE", note, "check the file, or export it again"});
  if (!found.unit_conflict.empty())
    result.warnings.push_back(
        {"TRI-UNIT", found.unit_conflict, "name the unit: option 'marker-unit' m, cm, mm, in or e.g. 25mm"});
  return result;
}

/// What was asked about causes is added to `result`, the errors of which stand so far. True where nothing is left to say.
CauseFinding AnswerOf(const TriangulateReport& report, const CommandResult& so_far) {
  const bool timed = !report.options.sync.empty();
  switch (report.asked) {
    case CauseQuestion::kNone:
      break;
    case CauseQuestion::kTiming:
      return CauseInTiming(report.causes, timed);
    case CauseQuestion::kCamera:
      return CauseInCamera(report.causes, timed);
    case CauseQuestion::kScatter:
      return CauseInScatter(report.causes, timed);
    case CauseQuestion::kLoss:
      return CauseOfLoss(report.causes, "TRI-CAUSE", so_far.errors.back().hint);
  }
  return {};
}

/// One error ends a command: what else is wrong is a warning.
CommandResult WithOneError(CommandResult result) {
  std::vector<Notice>& errors = result.errors;
  if (errors.size() < 2) return result;
  Append({errors.begin(), errors.end() - 1}, &result.warnings);
  errors.erase(errors.begin(), errors.end() - 1);
  return result;
}

/// What was settled before the points were judged.
CommandResult DescribeWork(const TriangulateReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  if (report.project) {
    result.metrics["project"] = ProjectUseJson(*report.project);
    result.text = ProjectText(*report.project);
  }
  if (report.budget) result.Add(Describe(*report.budget));
  if (report.offsets) result.metrics["calibration_offsets"] = OffsetUseJson(*report.offsets);
  if (report.filter) result.Add(DescribeFilter(*report.filter));
  if (report.refined_without_bones) {
    result.warnings.push_back({"TRI-NO-BONES",
                               "the joints have no bones: option 'refine' has no lengths to hold, smoothness alone is tried",
                               "name the bones in a file, option 'skeleton' FILE.toml (docs/formats.md)"});
  }
  if (report.refinement) result.Add(DescribeRefinement(*report.refinement));
  if (report.project) result.Add(DescribeProjectFiles(*report.project));
  return result;
}

/// Figures, and what they say against the take.
CommandResult DescribeJudgement(const TriangulateReport& report) {
  CommandResult result;
  result.metrics = PointMetrics(report.points);
  result.metrics.update(TakeMetrics(report.take, report.skeleton));
  result.warnings = DetectionNotices(report.points, report.options.points.max_persons);
  for (const ReferenceComparison& comparison : report.comparisons) result.Add(DescribeComparison(comparison));
  result.Add(DescribeLimbs(report.limbs, report.skeleton.name));
  result.Add(DescribeUp(report.trunk_tilt_deg, report.rig, report.options.out));
  result.Add(DescribeLoss(report.loss, report.points, report.options.points));
  result.Add(DescribeInconsistency(report));
  const bool failed = !result.errors.empty(), known = report.loss.reason != Loss::Reason::kUnknown;
  const CauseFinding answer = AnswerOf(report, result);
  if (report.asked == CauseQuestion::kLoss) result.errors.back().hint = answer.remedy;
  result.Add(answer.said);
  // Of a lost take the cameras' own figures are of chance.
  if (!failed && !known && !answer.clear) Append(CameraNotices(report.take), &result.warnings);
  return WithOneError(std::move(result));
}

CommandResult DescribePoints(const TriangulateReport& report) {
  CommandResult result;
  for (const char* name : {"points.csv", "covariance.csv", "pose3d.json"}) {
    result.outputs.push_back(
        {(std::filesystem::path(report.options.out) / name).string(), name == std::string("points.csv") ? "points" : ""});
  }
  result.Add(DescribeCovarianceUse(report.rig, report.cameras, report.WhyWithoutCovariance()));
  if (report.offsets) {
    result.text += std::string("calibration's time offsets: ") + (report.offsets->applied ? "applied" : "not applied") + ", " +
                   report.offsets->reason + "\n";
  }
  return result;
}

/// Marker files that were written, or that were made of older points.
CommandResult DescribeMarkerFolder(const TriangulateReport& report) {
  CommandResult result;
  const std::string folder = report.MarkerFolder();
  if (report.markers) {
    result.warnings = MarkerWorldConflicts(report.markers->world, report.options.markers);
    result.Add(DescribeMarkers(*report.markers));
  }
  for (const ReferenceComparison& comparison : report.comparisons) {
    if (!comparison.written) continue;
    result.text += ComparisonText(comparison.option, ", filled and filtered as written", *comparison.written).substr(1) + "\n";
  }
  if (report.old_markers == OldMarkers::kRemoved) {
    result.text = "removed " + folder + ": made of the points that were replaced; option 'to' writes it again\n";
  } else if (report.old_markers == OldMarkers::kLeft) {
    result.warnings.push_back(
        {"TRI-OLD-MARKERS",
         folder + ": made of points that this run replaced; it also holds files that mvstudio did not write, "
                  "so it was left as it is",
         "move those files away, then option 'to' with option 'overwrite' writes the markers of the new points"});
  }
  return result;
}

}  // namespace

CommandResult Describe(const TriangulateReport& report) {
  CommandResult result = DescribeWork(report);
  result.Add(DescribeJudgement(report));
  if (report.kept_older) {
    result.warnings.push_back(OlderKept((std::filesystem::path(report.options.out) / "points.csv").string()));
    return result;
  }
  result.folder = report.options.out;
  result.text = SummaryOf(report) + result.text;
  result.Add(DescribePoints(report));
  if (report.views) result.Add(DescribeJointViews(*report.views));
  result.Add(DescribeMarkerFolder(report));
  return result;
}

}  // namespace mvstudio::stages
