#include "cli/calib/calib.h"
#include "cli/program/options.h"
#include "core/error.h"
#include "stages/calibrate/describe.h"
#include "stages/refine/describe.h"

namespace mvstudio::cli {
namespace {

struct RefineFlags {
  stages::CalibrateOptions boards;
  stages::RefineOptions keypoints;
};

CommandResult Refine(RefineFlags flags, const RunContext& run) {
  stages::RefineOptions& keypoints = flags.keypoints;
  if (keypoints.IsGiven()) {
    keypoints.pose.calib = flags.boards.start, keypoints.out = flags.boards.out;
    return Describe(stages::RunRefine(keypoints, run));
  }
  if (!keypoints.pose.pose2d.empty()) throw UsageError("--pose2d belongs to --from-keypoints");
  return Describe(stages::RunCalibrate(flags.boards, run));
}

}  // namespace

void RegisterCalibRefine(CLI::App& calib, Registry& registry) {
  const auto flags = std::make_shared<RefineFlags>();
  CLI::App* sub = calib.add_subcommand("refine",
                                       "Adjust an existing calibration to footage of a board (--fix keeps parts of it) or to "
                                       "people, markers or animals (--from-keypoints)");
  StartGroup(sub, "Known calibrations");
  AddOption(sub, "--calib", flags->boards.start, "the calibration to refine")->required();
  VisitBoardFields(OptionAdder{sub}, flags->boards);
  VisitFields(OptionAdder{sub}, flags->keypoints);
  sub->get_option("--person-height")->check(CLI::Range(0.3, 2.8));
  registry.Add(sub, "calib refine", [flags](CommandContext& context) { return Refine(*flags, context.run); });
}

}  // namespace mvstudio::cli
