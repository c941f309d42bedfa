#include "stages/eval/run.h"

#include <algorithm>
#include <optional>

#include "calib/board/sides.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/join.h"
#include "dataset/session/session.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::stages {
namespace {

/// From a session what was not named: its calibration, board and footage.
void FillFromSession(EvalReport* report) {
  EvalOptions& options = report->options;
  if (options.calibration.empty() && !options.session.session.empty()) {
    const bool outside = options.session.allow_outside;
    options.calibration = dataset::CalibrationOf(dataset::ReadSession(options.session.session, outside), outside);
  }
  if (options.calibration.empty())
    throw UsageError("CALIB is needed: the calibration to check, or a option 'session' that has been calibrated");
  FillCorners(options.session, &options.corners, &report->notes);
  FillTimeline(&options.corners, &report->notes);
}

/// Refuses corners of which the calibration has no camera. Throws FormatError.
void RequireKnownCamera(const geometry::Rig& rig, const std::string& path, const calib::CalibrateInput& input) {
  std::vector<std::string> names;
  for (const calib::CameraInput& camera : input.cameras) names.push_back(camera.name);
  if (std::any_of(names.begin(), names.end(), [&](const std::string& name) { return rig.Find(name) >= 0; })) return;
  throw FormatError(path, "cameras",
                    "has no " + Join(names, ", ") + "; it has " + Join(geometry::CameraNames(rig), ", ") +
                        ": rename its cameras with calib convert option 'rename'");
}

}  // namespace

EvalReport RunEval(EvalOptions given, const RunContext& run) {
  EvalReport report;
  report.options = std::move(given);
  const EvalOptions& options = report.options;
  FillFromSession(&report);
  std::optional<OutputFolder> place;
  if (!options.out.empty()) {
    std::vector<std::string> inputs = CornerPaths(options.corners);
    inputs.push_back(options.calibration);
    place.emplace(options.out, inputs, std::vector<std::string>{"calib_eval.result.json"});
  }
  calib::ImportedRig imported = ReadCalibrationFiles({options.calibration}, options.read);
  AddNotes(imported.notes, &report.notes);
  report.notes.inputs.push_back(options.calibration);
  report.rig = std::move(imported.rig);
  report.corners = ReadCornerInput(options.corners, run, &report.notes);
  const calib::CalibrateInput& input = report.corners.input;
  calib::RequireThickness(input.boards);
  RequireKnownCamera(report.rig, options.calibration, input);
  report.check = CheckRig(report.rig, input, options.check, run);
  if (report.check.status != Status::kOk || options.repair.empty()) return report;
  const OutputFiles repaired({options.repair}, report.notes.inputs);
  if (report.Repaired()) geometry::WriteRig(report.check.repaired, options.repair);
  return report;
}

}  // namespace mvstudio::stages
