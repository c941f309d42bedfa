#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/nets/pose2d/describe.h"

namespace mvstudio::cli {

void RegisterPose2d(CLI::App& app, Registry& registry) {
  const auto options = std::make_shared<stages::Pose2dOptions>();
  CLI::App* sub = app.add_subcommand("pose2d", "Detect 2D keypoints of people; one OpenPose JSON file per camera and frame");
  AddOptions(sub, *options);
  sub->get_option("--trial-frames")->check(CLI::Range(4, 10000));
  sub->get_option("--overlays")->check(CLI::Range(0, 1000));
  sub->get_option("--every")->check(CLI::Range(1, 1000000));
  registry.Add(sub, "pose2d", [options, sub](CommandContext& context) {
    options->given = GivenOptions(sub);
    return options->part.empty() ? Describe(stages::RunPose2d(*options, context.run))
                                 : Describe(stages::RunPose2dPart(*options, context.run));
  });
}

}  // namespace mvstudio::cli
