#include "app/input/corner_input.h"

#include "app/input/board_footage.h"
#include "app/input/board_pairing.h"
#include "core/error.h"

namespace mvstudio::app {
namespace {

CornerInput Detect(const CornerArguments& arguments, const RunContext& run, CommandResult* result) {
  if (arguments.boards.empty()) throw UsageError("option 'board' is needed: what to look for in the footage");
  const std::vector<calib::Board>& boards = arguments.boards;
  std::vector<calib::Footage> footage = OpenFootage(arguments.cameras, result);
  if (arguments.timeline) PairByTime(*arguments.timeline, &footage, result);
  for (const calib::Board& board : boards) {
    if (calib::HasUniqueNumbering(board) || footage.size() < 2) continue;
    result->warnings.push_back({"CAL-AMBIGUOUS", "the board " + calib::ToString(board) + " looks the same after half a turn",
                                "use a chessboard with one odd and one even number of corners, or ChArUco"});
  }
  CornerInput corners;
  corners.found = calib::DetectFootage(boards, footage, arguments.footage, run);
  for (const calib::FootageDetections& camera : corners.found) {
    for (const std::string& note : camera.notes) {
      result->warnings.push_back({"CAL-BOARD", "camera " + camera.camera.name + ": " + note, ""});
    }
  }
  corners.input = calib::ToCalibrateInput(boards, corners.found);
  return corners;
}

}  // namespace

CornerInput ReadCornerInput(const CornerArguments& arguments, const RunContext& run, CommandResult* result) {
  if (arguments.corners.empty()) return Detect(arguments, run, result);
  if (!arguments.cameras.empty())
    throw UsageError("give either option 'camera' (footage) or option 'corners' (a file), not both");
  if (arguments.boards.size() > 1) throw UsageError("option 'corners' takes one option 'board' at most");
  calib::CornerFileOptions options = arguments.corner_files;
  if (!arguments.boards.empty()) options.board = arguments.boards[0];
  const calib::CornerFile file = calib::ReadCornerFile(arguments.corners, options);
  result->inputs.push_back(arguments.corners);
  for (const auto& note : file.notes) result->warnings.push_back({note.code, note.text, note.hint});
  CornerInput corners;
  corners.input.boards = file.boards;
  corners.input.cameras = file.cameras;
  corners.input.detections = file.detections;
  return corners;
}

}  // namespace mvstudio::app
