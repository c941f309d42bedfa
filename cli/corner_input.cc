#include "cli/corner_input.h"

#include "cli/footage.h"
#include "core/error.h"

namespace mvstudio::cli {
namespace {

calib::CalibrateInput Detect(const CornerArguments& arguments, CommandContext& context, CommandResult* result) {
  if (arguments.boards.empty()) throw UsageError("--board is needed: what to look for in the footage");
  std::vector<calib::Board> boards;
  for (const std::string& text : arguments.boards) boards.push_back(calib::ParseBoard(text));
  std::vector<calib::Footage> footage = OpenFootage(arguments.cameras, result);
  const std::vector<calib::FootageDetections> found = calib::DetectFootage(boards, footage, arguments.footage, context.run);
  for (const calib::FootageDetections& camera : found) {
    for (const std::string& note : camera.notes) {
      result->warnings.push_back({"CAL-BOARD", "camera " + camera.camera.name + ": " + note, ""});
    }
  }
  return calib::ToCalibrateInput(boards, found);
}

}  // namespace

void AddCornerArguments(CLI::App* sub, CornerArguments& arguments) {
  sub->add_option("--board", arguments.boards,
                  "the board in the footage, as for calibrate (docs/boards.md); repeat for several boards");
  sub->add_option("--camera", arguments.cameras, "NAME=PATH: a video, a folder or a pattern in quotes; repeat for each camera");
  sub->add_option("--corners", arguments.corners, "a file of corners found before, instead of footage (docs/corner-files.md)");
  AddOptions(sub, arguments.footage);
  AddOptions(sub, arguments.corner_files);
}

calib::CalibrateInput ReadCornerInput(const CornerArguments& arguments, CommandContext& context, CommandResult* result) {
  if (arguments.corners.empty()) return Detect(arguments, context, result);
  if (!arguments.cameras.empty()) throw UsageError("give either --camera (footage) or --corners (a file), not both");
  if (arguments.boards.size() > 1) throw UsageError("--corners takes one --board at most");
  calib::CornerFileOptions options = arguments.corner_files;
  if (!arguments.boards.empty()) options.board = calib::ParseBoard(arguments.boards[0]);
  const calib::CornerFile file = calib::ReadCornerFile(arguments.corners, options);
  result->inputs.push_back(arguments.corners);
  for (const auto& note : file.notes) result->warnings.push_back({note.code, note.text, note.hint});
  calib::CalibrateInput input;
  input.boards = file.boards;
  input.cameras = file.cameras;
  input.detections = file.detections;
  return input;
}

}  // namespace mvstudio::cli
