#include "cli/people/points_out.h"

#include <cmath>
#include <filesystem>

#include "app/people/pose_truth.h"
#include "app/words.h"
#include "core/disk/manifest.h"
#include "core/error.h"
#include "core/format.h"
#include "core/some_of.h"
#include "dataset/footage/frame_rate.h"
#include "dataset/pose/markers.h"
#include "dataset/pose/pose3d.h"

namespace mvstudio::cli {

using app::CommandResult;
using nlohmann::ordered_json;

namespace {

double NumberOf(const ordered_json& value) { return value.is_number() ? value.get<double>() : std::nan(""); }

/// The points as they were written as markers, where that changed them.
void CompareWritten(const MarkerFolderArguments& arguments, const dataset::Pose3d& written, CommandResult* result) {
  if (arguments.options.filter == "none" && arguments.options.fill_frames == 0) return;
  const ComparisonArguments& with = arguments.comparison;
  const auto compare = [&](const char* key, const std::string& path, bool align) {
    if (path.empty()) return;
    ordered_json& json = result->metrics[key]["written"];
    json = app::ComparisonToJson(app::CompareWithTruth(written, path, {align, with.marker_unit}));
    result->text += ComparisonText(key, ", filled and filtered as written", json).substr(1) + "\n";
  };
  compare("trc", with.trc, false);
  compare("truth", with.truth, with.align_truth);
}

}  // namespace

void CheckComparison(const ComparisonArguments& arguments) {
  if (!arguments.trc.empty()) dataset::ReadMarkers(arguments.trc, arguments.marker_unit);
  if (arguments.truth.empty()) return;
  if (!std::filesystem::exists(arguments.truth)) throw IoError(arguments.truth, "--truth does not exist");
  const std::string found = dataset::PointsFileAt(arguments.truth);
  if (dataset::IsPointsFile(found) && std::filesystem::path(found).filename() != "points.csv")
    dataset::ReadMarkers(found, arguments.marker_unit);
}

void AddComparisons(const ComparisonArguments& arguments, const std::string& out, CommandResult* result) {
  if (arguments.trc.empty() && arguments.truth.empty()) return;
  const dataset::Pose3d pose = dataset::ReadPose3d(out);
  const auto compare = [&](const char* key, const std::string& truth, bool align) {
    if (truth.empty()) return;
    const app::TruthComparison comparison = app::CompareWithTruth(pose, truth, {align, arguments.marker_unit});
    result->metrics[key] = app::ComparisonToJson(comparison);
    result->inputs.push_back(truth);
    if (comparison.comparison.num == 0) app::AddNothingInCommon(key, truth, comparison.comparison.why_none, result);
    for (const std::string& note : comparison.notes)
      result->warnings.push_back({"TRI-MARKER-FILE", note, "check the file, or export it again"});
    if (comparison.unit_doubt.empty()) return;
    result->warnings.push_back({"TRI-UNIT", comparison.unit_doubt, "name the unit: --marker-unit m, cm, mm, in or e.g. 25mm"});
  };
  compare("trc", arguments.trc, false);
  compare("truth", arguments.truth, arguments.align_truth);
}

std::string ComparisonText(const std::string& key, const std::string& what, const ordered_json& m) {
  if (m["num"] == 0) return "\nagainst " + key + what + ": nothing could be compared, " + m["why_none"].get<std::string>();
  std::string text = Format("\nagainst %s%s: median %s, p95 %s, %d joints", key.c_str(), what.c_str(),
                            app::LengthText(NumberOf(m["median_mm"]) / 1e3).c_str(),
                            app::LengthText(NumberOf(m["p95_mm"]) / 1e3).c_str(), m["num"].get<int>());
  if (m.contains("unit"))
    text += Format(" (its unit %s, %s up)", m["unit"].get<std::string>().c_str(), m["up"].get<std::string>().c_str());
  if (m.contains("without_counterpart"))
    text += "; not compared, by their names: " + SomeOf(m["without_counterpart"].get<std::vector<std::string>>());
  if (m.contains("persons_left_out"))
    text += Format("; %d other person(s) have no counterpart in it", m["persons_left_out"].get<int>());
  return text;
}

void FillMarkerOptions(const std::optional<app::FoundTake>& found, double footage_hz, const app::PoseChanges& changes,
                       app::MarkerOptions* options, CommandResult* result) {
  const double session_hz = found ? found->take.fps_hz.value_or(found->session.fps_hz.value_or(0)) : 0;
  const double stated_hz = session_hz > 0 ? session_hz : footage_hz;
  const double changed_hz = app::StepRateHz(changes);
  if (options->rate_hz > 0 && stated_hz > 0 && changed_hz == 0 && !dataset::IsSameRate(options->rate_hz, stated_hz)) {
    result->warnings.push_back({"MRK-RATE",
                                Format("the %s has %g frames a second; --frame-rate %g is used",
                                       session_hz > 0 ? "session" : "footage", stated_hz, options->rate_hz),
                                "speeds and accelerations depend on it: leave --frame-rate out to take the footage's"});
  }
  if (options->rate_hz == 0) options->rate_hz = changed_hz > 0 ? changed_hz : stated_hz;
  if (options->rate_hz != 0 && !dataset::IsFrameRate(options->rate_hz))
    throw UsageError(std::string("--frame-rate ") + dataset::kFrameRates);
  if (options->to.empty()) {
    if (options->fill_frames != 0 || options->filter != "none" || options->opensim) {
      throw UsageError("--filter, --fill and --opensim are for marker files: name them, e.g. --to trc");
    }
    return;
  }
  CheckMarkerOptions(*options);
  if (options->rate_hz == 0)
    throw UsageError("--frame-rate: marker files state it; give that of the footage, e.g. --frame-rate 60");
}

void DropOldMarkers(const std::string& folder, CommandResult* result) {
  if (!ReadManifest(folder)) return;
  if (FilesInTheWay(folder).empty()) {
    RemoveOurs({folder});
    result->text += "removed " + folder + ": made of the points that were replaced; --to writes it again\n";
    return;
  }
  result->warnings.push_back({"TRI-OLD-MARKERS",
                              folder +
                                  ": made of points that this run replaced; it also holds files that mvstudio did not write, "
                                  "so it was left as it is",
                              "move those files away, then --to with --overwrite writes the markers of the new points"});
}

void WriteMarkerFolder(const MarkerFolderArguments& arguments, AtomicFolder* folder, CommandResult* result) {
  if (result->metrics["num_points"] == 0) return;
  const dataset::Pose3d pose = dataset::ReadPose3d(arguments.points);
  app::CheckMarkerWorld(pose.world, arguments.options, result);
  const auto work = PrepareMarkers(pose, arguments.options, arguments.points);
  WriteMarkers(work, pose, arguments.options, folder->work_path(), arguments.folder, result);
  dataset::Pose3d written = app::PoseOf(work);
  written.skeleton = pose.skeleton, written.definition = pose.definition;
  CompareWritten(arguments, written, result);
  folder->Commit();
}

}  // namespace mvstudio::cli
