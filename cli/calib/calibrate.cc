#include "calib/calibrate.h"

#include <chrono>
#include <filesystem>
#include <memory>

#include "app/calib/calibrate_result.h"
#include "app/calib/calibration_use.h"
#include "app/input/board_pairing.h"
#include "app/input/calib_read.h"
#include "app/input/corner_input.h"
#include "app/input/session_input.h"
#include "calib/corners/corner_files.h"
#include "cli/calib/calib.h"
#include "cli/calib/keypoints.h"
#include "cli/calib/scene.h"
#include "cli/program/commands.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::cli {
namespace {

struct Arguments {
  app::SessionArguments session;
  app::CornerArguments corners;
  std::string save_corners, start, out;
  calib::CalibrateOptions calibrate;
  SceneArguments scene;
  KeypointArguments keypoints;
};

void RequireSizes(const app::CornerInput& corners, const std::string& path) {
  for (const calib::CameraInput& camera : corners.input.cameras) {
    if (camera.width_px <= 0 || camera.height_px <= 0)
      throw UsageError(path + " does not say how large the images of camera " + camera.name + " are; give --size WIDTHxHEIGHT");
  }
}

void SaveCorners(const app::CornerInput& corners, const std::string& path, CommandResult* result) {
  calib::CornerFile file;
  file.cameras = corners.input.cameras;
  file.boards = corners.input.boards;
  file.detections = corners.input.detections;
  const OutputFiles place({path}, result->inputs);
  calib::WriteCornerFile(file, path);
  result->outputs.push_back({path, "corners"});
}

/// Where boards were paired by number, a session's videos may know better.
std::string HintFor(const calib::Verdict::Reason& reason, const Arguments& arguments) {
  if (reason.code != "CAL-FRAMES" || arguments.session.session.empty() || arguments.corners.timeline) return reason.hint;
  return reason.hint + "; `mvstudio session timeline` with the board's --take reads dropped frames from time stamps, and " +
         "calibrate then pairs by time";
}

CommandResult Unsolved(const calib::CalibrateReport& report) {
  CommandResult result;
  result.exit = kExitIllPosed;
  result.metrics["status"] = std::string(ToString(report.status));
  result.metrics["verdict"] = app::VerdictJson(report.verdict);
  if (!report.frame_shift.empty()) result.metrics["frame_shift"] = report.frame_shift;
  result.errors.push_back({"CAL-UNSOLVED", report.message, "see metrics.status"});
  result.text = report.message + "\n";
  return result;
}

std::vector<std::string> InputsOf(const Arguments& arguments) {
  return Joined(PathsIn(arguments.corners.cameras), {arguments.corners.corners, arguments.start, arguments.scene.from_scene});
}

CommandResult RunCalibrate(Arguments arguments, CommandContext& context) {
  if (arguments.out.empty() && !arguments.session.session.empty()) arguments.out = arguments.session.session + "/calib";
  if (arguments.out.empty()) throw UsageError("--out is required, or a --session to write to");
  std::vector<std::string> names = {"calibration.json"};
  if (!arguments.scene.from_scene.empty()) names.push_back("colmap");
  const OutputFolder place(arguments.out, InputsOf(arguments), names);
  if (UsesScene(arguments.scene))
    return RunScene(arguments.scene, arguments.start, arguments.corners.boards, arguments.out, context);
  CommandResult result;
  app::FillCorners(arguments.session, &arguments.corners, &result);
  const auto start = std::chrono::steady_clock::now();
  app::CornerInput corners = app::ReadCornerInput(arguments.corners, context.run, &result);
  RequireSizes(corners, arguments.corners.corners);
  if (!arguments.save_corners.empty()) SaveCorners(corners, arguments.save_corners, &result);
  if (!arguments.start.empty()) {
    const calib::ImportedRig given = app::ReadCalibrationFiles({arguments.start}, {});
    corners.input.start = given.rig;
    app::AddNotes(given.notes, &result);
    result.inputs.push_back(arguments.start);
  }
  const calib::CalibrateReport report = Calibrate(corners.input, arguments.calibrate, context.run);
  if (report.status != Status::kOk) {
    CommandResult unsolved = Unsolved(report);
    unsolved.metrics["pairing"] = app::PairingJson(arguments.corners.timeline.get());
    unsolved.warnings = result.warnings;
    unsolved.outputs = result.outputs;
    return unsolved;
  }
  result.folder = arguments.out;
  const std::string path = arguments.out + "/calibration.json";
  geometry::WriteRig(report.rig, path);
  result.outputs.push_back({path, "calibration"});
  app::FillCalibrateMetrics(report, corners.found, &result.metrics);
  result.metrics["pairing"] = app::PairingJson(arguments.corners.timeline.get());
  result.metrics["wall_s"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (report.rig.cameras.size() > 1) result.text = app::PairingText(arguments.corners.timeline.get());
  result.text += app::CalibrateSummary(report);
  for (const auto& reason : report.verdict.reasons)
    result.warnings.push_back({reason.code, reason.text, HintFor(reason, arguments)});
  if (report.verdict.status == "fail") result.exit = kExitQualityGate;
  app::WarnOfCovariance(report.rig, &result);
  return result;
}

void AddArguments(CLI::App* sub, const std::shared_ptr<Arguments>& arguments) {
  AddCornerArguments(sub, arguments->corners);
  AddSessionArguments(sub, arguments->session, "board and footage", "a board");
  AddOption(sub, "--save-corners", arguments->save_corners, "also write the corners that were found, CSV");
  AddOption(sub, "--out", arguments->out, "folder for calibration.json; SESSION/calib unless given");
  AddOptions(sub, arguments->calibrate);
}

}  // namespace

void RegisterCalibrate(CLI::App& app, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("calibrate", "Calibrate cameras from footage of a board, or from its corners");
  AddArguments(sub, arguments);
  AddOptions(sub, arguments->scene);
  AddOption(sub, "--start", arguments->start, "a calibration to start from; its cameras keep their lens models");
  registry.Add(sub, "calibrate", [arguments](CommandContext& context) { return RunCalibrate(*arguments, context); });
}

void RegisterCalibRefine(CLI::App& calib, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = calib.add_subcommand("refine",
                                       "Adjust an existing calibration to footage of a board (--fix keeps parts of it) or to "
                                       "people, markers or animals (--from-keypoints)");
  AddOption(sub, "--calib", arguments->start, "the calibration to refine")->required();
  AddArguments(sub, arguments);
  AddKeypointArguments(sub, arguments->keypoints);
  registry.Add(sub, "calib refine", [arguments](CommandContext& context) {
    const KeypointArguments& keypoints = arguments->keypoints;
    if (keypoints.IsGiven() && arguments->out.empty()) throw UsageError("--out is required with --from-keypoints");
    if (!keypoints.IsGiven() && !keypoints.pose2d.empty()) throw UsageError("--pose2d belongs to --from-keypoints");
    return keypoints.IsGiven() ? RunKeypoints(keypoints, arguments->start, arguments->out, context)
                               : RunCalibrate(*arguments, context);
  });
}

}  // namespace mvstudio::cli
