#include "cli/calib/calib.h"
#include "cli/calib/keypoints.h"
#include "cli/program/options.h"
#include "core/error.h"
#include "stages/calibrate/describe.h"

namespace mvstudio::cli {
namespace {

struct Arguments {
  stages::CalibrateOptions board;
  KeypointArguments keypoints;
};

CommandResult Refine(const Arguments& arguments, CommandContext& context) {
  const KeypointArguments& keypoints = arguments.keypoints;
  if (keypoints.IsGiven() && arguments.board.out.empty()) throw UsageError("--out is required with --from-keypoints");
  if (!keypoints.IsGiven() && !keypoints.pose2d.empty()) throw UsageError("--pose2d belongs to --from-keypoints");
  if (!keypoints.IsGiven()) return Describe(stages::RunCalibrate(arguments.board, context.run));
  return RunKeypoints(keypoints, arguments.board.start, arguments.board.out, context);
}

}  // namespace

void RegisterCalibRefine(CLI::App& calib, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = calib.add_subcommand("refine",
                                       "Adjust an existing calibration to footage of a board (--fix keeps parts of it) or to "
                                       "people, markers or animals (--from-keypoints)");
  StartGroup(sub, "Known calibrations");
  AddOption(sub, "--calib", arguments->board.start, "the calibration to refine")->required();
  VisitBoardFields(OptionAdder{sub}, arguments->board);
  AddKeypointArguments(sub, arguments->keypoints);
  registry.Add(sub, "calib refine", [arguments](CommandContext& context) { return Refine(*arguments, context); });
}

}  // namespace mvstudio::cli
