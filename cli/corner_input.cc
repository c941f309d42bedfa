#include "cli/corner_input.h"

#include "cli/footage.h"
#include "cli/options.h"
#include "core/error.h"

namespace mvstudio::cli {
namespace {

CornerInput Detect(const CornerArguments& arguments, CommandContext& context, CommandResult* result) {
  if (arguments.boards.empty()) throw UsageError("--board is needed: what to look for in the footage");
  std::vector<calib::Board> boards;
  for (const std::string& text : arguments.boards) boards.push_back(calib::ParseBoard(text));
  std::vector<calib::Footage> footage = OpenFootage(arguments.cameras, result);
  for (const calib::Board& board : boards) {
    if (calib::HasUniqueNumbering(board) || footage.size() < 2) continue;
    result->warnings.push_back({"CAL-AMBIGUOUS", "the board " + calib::ToString(board) + " looks the same after half a turn",
                                "use a chessboard with one odd and one even number of corners, or ChArUco"});
  }
  CornerInput corners;
  corners.found = calib::DetectFootage(boards, footage, arguments.footage, context.run);
  for (const calib::FootageDetections& camera : corners.found) {
    for (const std::string& note : camera.notes) {
      result->warnings.push_back({"CAL-BOARD", "camera " + camera.camera.name + ": " + note, ""});
    }
  }
  corners.input = calib::ToCalibrateInput(boards, corners.found);
  return corners;
}

}  // namespace

void AddCornerArguments(CLI::App* sub, CornerArguments& arguments) {
  AddOption(sub, "--board", arguments.boards,
            "chessboard:COLSxROWS:SQUARE (inner corners), charuco:COLSxROWS:SQUARE:MARKER[:DICT], aprilgrid:…, tag:… or "
            "grid:… (docs/boards.md); repeat for boards that are fixed to each other");
  AddOption(sub, "--camera", arguments.cameras, "NAME=PATH: a video, a folder or a pattern in quotes; repeat for each camera");
  AddOption(sub, "--corners", arguments.corners, "a file of corners found before, instead of footage (docs/corner-files.md)");
  AddOptions(sub, arguments.footage);
  AddOptions(sub, arguments.corner_files);
}

CornerInput ReadCornerInput(const CornerArguments& arguments, CommandContext& context, CommandResult* result) {
  if (arguments.corners.empty()) return Detect(arguments, context, result);
  if (!arguments.cameras.empty()) throw UsageError("give either --camera (footage) or --corners (a file), not both");
  if (arguments.boards.size() > 1) throw UsageError("--corners takes one --board at most");
  calib::CornerFileOptions options = arguments.corner_files;
  if (!arguments.boards.empty()) options.board = calib::ParseBoard(arguments.boards[0]);
  const calib::CornerFile file = calib::ReadCornerFile(arguments.corners, options);
  result->inputs.push_back(arguments.corners);
  for (const auto& note : file.notes) result->warnings.push_back({note.code, note.text, note.hint});
  CornerInput corners;
  corners.input.boards = file.boards;
  corners.input.cameras = file.cameras;
  corners.input.detections = file.detections;
  return corners;
}

}  // namespace mvstudio::cli
