#include <chrono>
#include <filesystem>
#include <memory>

#include "calib/calibrate.h"
#include "calib/corner_files.h"
#include "calib/detect_footage.h"
#include "cli/calib_read.h"
#include "cli/calibrate_result.h"
#include "cli/command_calib.h"
#include "cli/commands.h"
#include "cli/footage.h"
#include "core/error.h"
#include "core/files.h"
#include "geometry/rig_io.h"

namespace mvstudio::cli {
namespace {

struct Arguments {
  std::vector<std::string> boards, cameras;
  std::string corners, save_corners, start, out;
  calib::FootageOptions footage;
  calib::CornerFileOptions corner_files;
  calib::CalibrateOptions calibrate;
};

/// Corners, from footage or a file.
struct Corners {
  calib::CalibrateInput input;
  std::vector<calib::FootageDetections> found;  ///< footage only
};

std::vector<calib::Board> ParseBoards(const Arguments& arguments) {
  std::vector<calib::Board> boards;
  for (const std::string& text : arguments.boards) boards.push_back(calib::ParseBoard(text));
  return boards;
}

Corners DetectCorners(const Arguments& arguments, CommandContext& context, CommandResult* result) {
  const std::vector<calib::Board> boards = ParseBoards(arguments);
  if (boards.empty()) throw UsageError("--board is needed: what to look for in the footage");
  std::vector<calib::Footage> footage = OpenFootage(arguments.cameras, result);
  for (const calib::Board& board : boards) {
    if (calib::HasUniqueNumbering(board) || footage.size() < 2) continue;
    result->warnings.push_back({"CAL-AMBIGUOUS", "the board " + calib::ToString(board) + " looks the same after half a turn",
                                "use a chessboard with one odd and one even number of corners, or ChArUco"});
  }
  Corners corners;
  corners.found = calib::DetectFootage(boards, footage, arguments.footage, context.run);
  corners.input = calib::ToCalibrateInput(boards, corners.found);
  for (const calib::FootageDetections& camera : corners.found) {
    for (const std::string& note : camera.notes)
      result->warnings.push_back({"CAL-BOARD", "camera " + camera.camera.name + ": " + note, ""});
  }
  return corners;
}

Corners ReadCorners(const Arguments& arguments, CommandResult* result) {
  if (!arguments.cameras.empty()) throw UsageError("give either --camera (footage) or --corners (a file), not both");
  calib::CornerFileOptions options = arguments.corner_files;
  if (arguments.boards.size() > 1) throw UsageError("--corners takes one --board at most");
  if (!arguments.boards.empty()) options.board = calib::ParseBoard(arguments.boards[0]);
  const calib::CornerFile file = calib::ReadCornerFile(arguments.corners, options);
  result->inputs.push_back(arguments.corners);
  for (const auto& note : file.notes) result->warnings.push_back({note.code, note.text, note.hint});
  for (const calib::CameraInput& camera : file.cameras) {
    if (camera.width_px <= 0 || camera.height_px <= 0)
      throw UsageError(arguments.corners + " does not say how large the images of camera " + camera.name +
                       " are; give --size WIDTHxHEIGHT");
  }
  Corners corners;
  corners.input.boards = file.boards;
  corners.input.cameras = file.cameras;
  corners.input.detections = file.detections;
  return corners;
}

void SaveCorners(const Corners& corners, const std::string& path, CommandResult* result) {
  calib::CornerFile file;
  file.cameras = corners.input.cameras;
  file.boards = corners.input.boards;
  file.detections = corners.input.detections;
  calib::WriteCornerFile(file, path);
  result->outputs.push_back({path, "corners"});
}

CommandResult Unsolved(const calib::CalibrateReport& report) {
  CommandResult result;
  result.exit = kExitIllPosed;
  result.metrics["status"] = std::string(ToString(report.status));
  result.metrics["verdict"] = VerdictJson(report.verdict);
  if (!report.frame_shift.empty()) result.metrics["frame_shift"] = report.frame_shift;
  result.errors.push_back({"CAL-UNSOLVED", report.message, "see metrics.status"});
  result.text = report.message + "\n";
  return result;
}

CommandResult RunCalibrate(const Arguments& arguments, CommandContext& context) {
  CommandResult result;
  const auto start = std::chrono::steady_clock::now();
  Corners corners = arguments.corners.empty() ? DetectCorners(arguments, context, &result) : ReadCorners(arguments, &result);
  if (!arguments.save_corners.empty()) SaveCorners(corners, arguments.save_corners, &result);
  if (!arguments.start.empty()) {
    const calib::ImportedRig given = ReadCalibrationFiles({arguments.start}, {});
    corners.input.start = given.rig;
    AddNotes(given.notes, &result);
    result.inputs.push_back(arguments.start);
  }
  const calib::CalibrateReport report = Calibrate(corners.input, arguments.calibrate, context.run);
  if (report.status != Status::kOk) {
    CommandResult unsolved = Unsolved(report);
    unsolved.warnings = result.warnings;
    unsolved.outputs = result.outputs;
    return unsolved;
  }
  result.folder = arguments.out;
  const std::string path = arguments.out + "/calibration.json";
  MakeFolder(arguments.out);
  geometry::WriteRig(report.rig, path);
  result.outputs.push_back({path, "calibration"});
  FillCalibrateMetrics(report, corners.found, &result.metrics);
  result.metrics["wall_s"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  result.text = CalibrateSummary(report, path);
  for (const auto& reason : report.verdict.reasons) result.warnings.push_back({reason.code, reason.text, reason.hint});
  if (report.verdict.status == "fail") result.exit = kExitQualityGate;
  return result;
}

void AddArguments(CLI::App* sub, const std::shared_ptr<Arguments>& arguments) {
  sub->add_option("--board", arguments->boards,
                  "chessboard:COLSxROWS:SQUARE (inner corners), charuco:COLSxROWS:SQUARE:MARKER[:DICT], aprilgrid:…, tag:… or "
                  "grid:… (docs/boards.md); repeat for boards that are fixed to each other");
  sub->add_option("--camera", arguments->cameras, "NAME=PATH: a video, a folder or a pattern in quotes; repeat for each camera");
  sub->add_option("--corners", arguments->corners, "a file of corners found before, instead of footage (docs/corner-files.md)");
  sub->add_option("--save-corners", arguments->save_corners, "also write the corners that were found, CSV");
  sub->add_option("--out", arguments->out, "folder for calibration.json")->required();
  AddOptions(sub, arguments->footage);
  AddOptions(sub, arguments->corner_files);
  AddOptions(sub, arguments->calibrate);
}

}  // namespace

void RegisterCalibrate(CLI::App& app, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("calibrate", "Calibrate cameras from footage of a board, or from its corners");
  AddArguments(sub, arguments);
  sub->add_option("--start", arguments->start, "a calibration to start from; its cameras keep their lens models");
  registry.Add(sub, "calibrate", [arguments](CommandContext& context) { return RunCalibrate(*arguments, context); });
}

void RegisterCalibRefine(CLI::App& calib, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = calib.add_subcommand("refine", "Adjust an existing calibration to footage of a board; --fix keeps parts of it");
  sub->add_option("--calib", arguments->start, "the calibration to refine")->required();
  AddArguments(sub, arguments);
  registry.Add(sub, "calib refine", [arguments](CommandContext& context) { return RunCalibrate(*arguments, context); });
}

}  // namespace mvstudio::cli
