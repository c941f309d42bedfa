#include "stages/align/run.h"

#include <filesystem>
#include <map>
#include <set>
#include <utility>

#include "calib/board/sides.h"
#include "calib/keypoints/moments.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/pose/markers.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"
#include "stages/people/human_shape.h"

namespace mvstudio::stages {
namespace {

using calib::RigAlignment;

void RequireOneWorld(const AlignOptions& o) {
  const int ways = (o.floor_board >= 0) + !o.floor_joints.empty() + !o.points.empty();
  if (ways != 1)
    throw UsageError("give one of option 'floor-board', option 'floor-joints' and option 'points': what the new world is");
  if (o.scale && o.points.empty())
    throw UsageError("option 'scale' belongs to option 'points': neither a board nor feet change the scale");
  if (!o.lengths.empty() && o.points.empty())
    throw UsageError(
        "option 'length' needs option 'points': what was triangulated with this calibration, or marks camera,point,x_px,y_px");
  if (!o.lengths.empty() && o.scale)
    throw UsageError(
        "option 'scale' takes the size from the places of points, option 'length' from their distances: give one of them");
  const bool footage = !o.session.session.empty() || !o.corners.cameras.empty() || !o.corners.corners.empty();
  if (o.floor_board >= 0 && !footage)
    throw UsageError(
        "option 'floor-board' needs the board's corners: option 'session', option 'camera' with option 'board', or option "
        "'corners'");
}

RigAlignment ByBoard(const geometry::Rig& rig, const RunContext& run, AlignReport* report) {
  AlignOptions& options = report->options;
  FillCorners(options.session, &options.corners, &report->notes);
  FillTimeline(&options.corners, &report->notes);
  report->corners = ReadCornerInput(options.corners, run, &report->notes);
  const calib::CalibrateInput& input = report->corners.input;
  calib::RequireThickness(input.boards);
  const calib::CalibrateInput seen = SeenCorners(rig, input, calib::CameraParts::kByFrame, &report->found);
  return AlignToBoard(rig, AtFrameTimes(seen, StatedTimeOffsets(rig, seen)), options.floor_board);
}

dataset::Pose3d PointsIn(const std::string& path, const std::string& unit, InputNotes* notes) {
  dataset::MarkerFile file;
  dataset::Pose3d pose = dataset::ReadPoints3d(path, unit, "", &file);
  for (const std::string& note : NotesOf(file, path))
    notes->warnings.push_back({"MRK-FILE", note, "the points must be in the world of the calibration"});
  return pose;
}

RigAlignment ByFeet(const geometry::Rig& rig, AlignReport* report) {
  const std::string& folder = report->options.floor_joints;
  const dataset::Pose3d pose = PointsIn(folder, report->options.marker_unit, &report->notes);
  report->notes.inputs.push_back(folder);
  if (pose.world != WorldText(rig)) {
    const std::string its = pose.world.empty() ? " states no world" : " states another world (" + pose.world + ")";
    report->notes.warnings.push_back({"CAL-ALIGN", folder + its + "; the calibration's is: " + WorldText(rig),
                                      "make sure that it was triangulated with this calibration"});
  }
  const FeetFloor& floor = report->floor.emplace(FloorUnderFeet(pose));
  RigAlignment out;
  out.status = floor.status, out.message = floor.message;
  out.num_points = floor.num_places, out.num_used = floor.num_used, out.rms_m = floor.rms_m;
  if (out.status != Status::kOk) return out;
  out.new_from_old = floor.floor_from_world;
  out.rig = geometry::InWorld(rig, floor.floor_from_world);
  out.rig.gauge = geometry::GaugeAfterMove({geometry::RigGauge::Kind::kFloor}, rig.gauge);
  return out;
}

/// The points that lengths are measured between: of a take, or marked in images of one moment.
std::vector<calib::NamedPoints> MeasuredMoments(const geometry::Rig& rig, AlignReport* report) {
  const std::vector<std::string>& paths = report->options.points;
  const bool marked = std::filesystem::is_regular_file(paths[0]) && calib::HasClicks(paths[0]);
  if (marked || paths.size() > 1) return {PointsOfMarks(rig, calib::ReadMarks(paths))};
  std::map<std::pair<int, int>, calib::NamedPoints> moments;  // frame, person
  const dataset::Pose3d pose = PointsIn(paths[0], report->options.marker_unit, &report->notes);
  for (const dataset::JointRow& row : pose.rows) {
    calib::NamedPoints& points = moments[{row.frame, row.person}];
    if (row.status == Status::kOk) points[row.joint] = row.x_in_world;
  }
  std::vector<calib::NamedPoints> ordered;
  for (auto& [key, points] : moments) ordered.push_back(std::move(points));
  return ordered;
}

RigAlignment ByLengths(const geometry::Rig& rig, AlignReport* report) {
  const std::vector<calib::StatedLength> stated = calib::ParseStatedLengths(report->options.lengths);
  const std::vector<calib::NamedPoints> moments = MeasuredMoments(rig, report);
  std::set<std::string> names;
  for (const calib::NamedPoints& points : moments)
    for (const auto& [name, x] : points) names.insert(name);
  const calib::LengthScale& scale =
      report->lengths.emplace(ScaleFromLengths(LengthsOf(stated, {names.begin(), names.end()}), moments));
  RigAlignment out;
  out.status = scale.status, out.message = scale.message;
  out.num_points = static_cast<int>(names.size());
  if (out.status != Status::kOk) return out;
  out.num_used = static_cast<int>(scale.rows.size()), out.scale = scale.scale;
  out.rig = geometry::InWorld(rig, {}, scale.scale);
  out.rig.gauge.stated_lengths = true;
  return out;
}

RigAlignment ByPoints(const geometry::Rig& rig, const AlignOptions& options) {
  if (options.points.size() == 1 && calib::HasPlacePairs(options.points[0]))
    return AlignToPlaces(rig, calib::ReadPlacePairs(options.points[0]), options.scale);
  return AlignToClicks(rig, calib::ReadScenePoints(options.points), options.scale, options.clicks);
}

RigAlignment AlignedAsAsked(const geometry::Rig& rig, const RunContext& run, AlignReport* report) {
  const AlignOptions& options = report->options;
  if (options.floor_board >= 0) return ByBoard(rig, run, report);
  if (!options.floor_joints.empty()) return ByFeet(rig, report);
  report->notes.inputs.insert(report->notes.inputs.end(), options.points.begin(), options.points.end());
  return options.lengths.empty() ? ByPoints(rig, options) : ByLengths(rig, report);
}

}  // namespace

AlignReport RunAlign(AlignOptions given, const RunContext& run) {
  AlignReport report;
  report.options = std::move(given);
  const AlignOptions& options = report.options;
  if (options.out.empty()) throw UsageError("option 'out' is required");
  RequireOneWorld(options);
  std::vector<std::string> inputs = {options.calibration};
  inputs.insert(inputs.end(), options.points.begin(), options.points.end());
  for (const NamedPath& camera : options.corners.cameras) inputs.push_back(camera.path);
  const OutputFiles place({options.out}, inputs);
  const calib::ImportedRig imported = ReadCalibrationFiles({options.calibration}, options.read);
  RequirePoses(imported.rig, options.calibration);
  AddNotes(imported.notes, &report.notes);
  report.notes.inputs.push_back(options.calibration);
  report.aligned = AlignedAsAsked(imported.rig, run, &report);
  if (report.aligned.status == Status::kOk) geometry::WriteRig(report.aligned.rig, options.out);
  return report;
}

}  // namespace mvstudio::stages
