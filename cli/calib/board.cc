#include "cli/program/arguments.h"
#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/board/describe.h"

namespace mvstudio::cli {
namespace {

void RegisterPropose(CLI::App& board, Registry& registry) {
  const auto options = std::make_shared<calib::ProposeOptions>();
  CLI::App* sub = board.add_subcommand("propose", "Boards that fit the paper, and the distances that they suit");
  AddOptions(sub, *options);
  sub->get_option("--paper")->check(OneOf({"a4", "a3", "a2", "a1", "letter"}));  // none has no size to fill
  registry.Add(sub, "board propose", [options](CommandContext&) { return Describe(stages::RunBoardProposals(*options)); });
}

void RegisterDraw(CLI::App& board, Registry& registry) {
  const auto options = std::make_shared<stages::BoardDrawing>();
  CLI::App* sub = board.add_subcommand("draw", "Write a board as PDF, SVG or PNG at true scale");
  AddOption(sub, "BOARD", options->board, calib::kBoardForms)->required();
  AddOptions(sub, *options);
  sub->get_option("--out")->required();
  registry.Add(sub, "board draw", [options](CommandContext&) { return Describe(stages::RunBoardDraw(*options)); });
}

void RegisterCheck(CLI::App& board, Registry& registry) {
  const auto options = std::make_shared<stages::BoardSearch>();
  CLI::App* sub = board.add_subcommand("check", "Find out which board is in the images, and how to write it");
  AddOption(sub, "IMAGES", options->images, "images, folders, patterns in quotes, or videos")->required();
  AddOptions(sub, *options);
  registry.Add(sub, "board check",
               [options](CommandContext& context) { return Describe(stages::RunBoardSearch(*options, context.run)); });
}

}  // namespace

void RegisterBoard(CLI::App& app, Registry& registry) {
  CLI::App* board = app.add_subcommand("board", "Propose and draw calibration boards, find out which one is in the images");
  board->require_subcommand(1);
  RegisterPropose(*board, registry);
  RegisterDraw(*board, registry);
  RegisterCheck(*board, registry);
}

}  // namespace mvstudio::cli
