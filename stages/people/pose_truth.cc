#include "stages/people/pose_truth.h"

#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "dataset/pose/markers.h"
#include "stages/input/pose3d_input.h"

namespace mvstudio::stages {
TruthComparison CompareWithTruth(const dataset::Pose3d& pose, const std::string& truth, const TruthOptions& options) {
  const auto scenes = ReadSceneFiles(truth);
  if (!scenes.empty()) return {ComparePose3d(ToCoco19Table(pose), dataset::ToTable(scenes), options.align)};
  const std::string found = dataset::PointsFileAt(truth);
  if (found.empty() || !std::filesystem::exists(found))
    throw IoError(truth,
                  "option 'truth' is neither a points.csv nor a file of markers (.trc, .c3d, .csv, …) nor a folder with "
                  "body3DScene_*.json, points.csv, or the 3D joints of FreeMoCap or DeepLabCut");
  dataset::MarkerFile file;
  const dataset::Pose3d reference = dataset::ReadPoints3d(truth, options.marker_unit, "", &file);
  const bool coco19 = pose.skeleton != "coco19" && reference.skeleton == "coco19";
  TruthComparison result{ComparePose3d(coco19 ? ToCoco19Table(pose) : dataset::ToTable(pose.rows),
                                       dataset::ToTable(reference.rows), options.align)};
  if (file.unit.empty()) return result;
  result.unit = file.unit, result.up = file.y_up ? "y" : "z";
  result.unit_conflict = dataset::UnitConflict(file, truth), result.notes = dataset::NotesOf(file, truth);
  return result;
}

Notice NothingInCommon(const std::string& option, const std::string& path, const std::string& why) {
  return {
      "TRI-NO-COMMON", "option '" + option + "' " + path + ": nothing could be compared: " + why,
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
