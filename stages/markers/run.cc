#include "stages/markers/run.h"

#include "core/disk/output.h"
#include "core/error.h"

namespace mvstudio::stages {
namespace {

void RequirePlaces(const PointsArguments& points, const std::string& out) {
  if (points.path.empty()) throw UsageError("name the points: a folder of triangulate, its points.csv, or a file of markers");
  if (out.empty()) throw UsageError("option 'out' is required: the folder (or the file) to write, e.g. option 'out' markers");
}

std::vector<std::string> MarkerInputs(const PointsArguments& points) { return {points.path, points.skeleton}; }

/// The points, and their rate where the options state none.
PointsInput ReadMarkerPoints(MarkersOptions* options, InputNotes* notes) {
  if (options->how.rate_hz != 0) options->points.rate_hz = options->how.rate_hz;
  PointsInput input = ReadPointsInput(options->points, notes);
  options->how.rate_hz = input.pose.frame_rate_hz;
  return input;
}

}  // namespace

MarkersReport RunMarkers(MarkersOptions options) {
  RequirePlaces(options.points, options.out);
  CheckMarkerOptions(options.how);
  AtomicFolder folder(options.out, options.overwrite, MarkerInputs(options.points));
  MarkersReport report;
  report.input = ReadMarkerPoints(&options, &report.notes);
  const dataset::Pose3d& pose = report.input.pose;
  Append(MarkerWorldConflicts(pose.world, options.how), &report.notes.warnings);
  report.written =
      WriteMarkers(PrepareMarkers(pose, options.how, options.points.path), pose, options.how, folder.work_path(), options.out);
  folder.Commit();
  report.options = std::move(options);
  return report;
}

MarkerEventsReport RunMarkerEvents(MarkersOptions options) {
  RequirePlaces(options.points, options.out);
  options.how.to = "csv";
  CheckMarkerOptions(options.how);
  AtomicFolder folder(options.out, options.overwrite, MarkerInputs(options.points));
  MarkerEventsReport report;
  report.input = ReadMarkerPoints(&options, &report.notes);
  const dataset::Pose3d& pose = report.input.pose;
  report.persons =
      WriteGaitEvents(PrepareMarkers(pose, options.how, options.points.path), pose, folder.work_path(), options.out);
  folder.Commit();
  report.options = std::move(options);
  return report;
}

MarkerConvertReport RunMarkerConvert(const MarkerConvertOptions& options) {
  RequirePlaces(options.points, options.out);
  MarkerConvertReport report;
  report.options = options;
  if (IsFileOfFormat(options.how, options.out)) {
    const OutputFiles place({options.out}, MarkerInputs(options.points));
    report.input = ReadPointsInput(options.points, &report.notes);
    report.written = ConvertMarkers(report.input.pose, options.points.path, options.how, options.out, "");
    return report;
  }
  AtomicFolder folder(options.out, options.overwrite, MarkerInputs(options.points));
  report.input = ReadPointsInput(options.points, &report.notes);
  report.written = ConvertMarkers(report.input.pose, options.points.path, options.how, options.out, folder.work_path());
  folder.Commit();
  return report;
}

}  // namespace mvstudio::stages
