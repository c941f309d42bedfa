#include "stages/people/pose_truth.h"

#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "dataset/pose/markers.h"
#include "stages/input/pose3d_input.h"

namespace mvstudio::stages {
TruthComparison CompareWithTruth(const dataset::Pose3d& pose, const std::string& truth, const TruthOptions& options) {
  const bool align = options.align;
  if (dataset::IsMarkerFile(truth)) {
    const dataset::MarkerFile markers = dataset::ReadMarkers(truth, options.marker_unit);
    const dataset::JointTable reference = dataset::ToTable(markers.pose.rows);
    return {ComparePose3d(dataset::ToTable(pose.rows), reference, align), markers.unit, markers.y_up ? "y" : "z",
            dataset::UnitDoubt(markers, truth), dataset::NotesOf(markers, truth)};
  }
  namespace fs = std::filesystem;
  const fs::path path(truth);
  const auto scenes = ReadSceneFiles(truth);
  if (!scenes.empty()) return {ComparePose3d(ToCoco19Table(pose), dataset::ToTable(scenes), align)};
  const fs::path table = fs::is_directory(path) ? path / "points.csv" : path;
  if (!fs::exists(table))
    throw IoError(
        truth, "option 'truth' is neither a points.csv nor a .trc or .c3d nor a folder with body3DScene_*.json or points.csv");
  const dataset::JointTable reference = dataset::ToTable(dataset::ReadPointsCsv(table.string()));
  const fs::path header = table.parent_path() / "pose3d.json";
  const bool coco19 =
      pose.skeleton != "coco19" && fs::exists(header) && dataset::ReadPose3d(table.parent_path().string()).skeleton == "coco19";
  return {ComparePose3d(coco19 ? ToCoco19Table(pose) : dataset::ToTable(pose.rows), reference, align)};
}

Notice NothingInCommon(const std::string& option, const std::string& path, const std::string& why) {
  return {"TRI-NO-COMMON", "option '" + option + "' " + path + ": nothing could be compared: " + why,
          "joints are compared by frame and name: give the reference of this take (a marker file's frame 1 is our frame 0), and "
          "joints called as in it"};
}

nlohmann::ordered_json ComparisonToJson(const TruthComparison& truth) {
  const dataset::Pose3dComparison& comparison = truth.comparison;
  const auto figure = [&](double mm) { return FiniteOrNull(comparison.num > 0 ? mm : std::nan("")); };
  nlohmann::ordered_json json = {{"median_mm", figure(comparison.median_mm)},
                                 {"mean_mm", figure(comparison.mean_mm)},
                                 {"p95_mm", figure(comparison.p95_mm)},
                                 {"max_mm", figure(comparison.max_mm)},
                                 {"num", comparison.num},
                                 {"aligned", comparison.aligned}};
  if (comparison.num == 0) json["why_none"] = comparison.why_none;
  if (!comparison.without_counterpart.empty()) json["without_counterpart"] = comparison.without_counterpart;
  if (comparison.persons_left_out > 0) json["persons_left_out"] = comparison.persons_left_out;
  if (comparison.num_covariance > 0) {
    json["coverage68"] = comparison.coverage68;
    json["coverage95"] = comparison.coverage95;
  }
  if (!truth.unit.empty()) json["unit"] = truth.unit, json["up"] = truth.up;
  return json;
}

}  // namespace mvstudio::stages
