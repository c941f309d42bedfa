#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/nets/lift/describe.h"

namespace mvstudio::cli {
namespace {

void RegisterTrain(CLI::App& lift, Registry& registry) {
  auto options = std::make_shared<stages::LiftTrainOptions>();
  CLI::App* sub = lift.add_subcommand("train", "Learn to lift from the 3D poses of datasets");
  AddOption(sub, "datasets", options->datasets, "dataset folders in Panoptic layout; images are not needed")->required();
  AddOptions(sub, *options);
  NameOutput(sub->get_option("--out")->required(), OutputKind::kFile);
  sub->get_option("--baseline-poses")->check(CLI::Range(1, 1000000));
  registry.Add(sub, "avatar lift train",
               [options](CommandContext& context) { return Describe(stages::RunLiftTrain(*options, context.run)); });
}

void RegisterApply(CLI::App& lift, Registry& registry) {
  auto options = std::make_shared<stages::LiftApplyOptions>();
  CLI::App* sub = lift.add_subcommand("apply", "2D joints of one camera -> 3D joints");
  AddOption(sub, "pose2d", options->pose2d, "folder of OpenPose JSON files, or a file with the results of a whole video")
      ->required();
  AddOptions(sub, *options);
  for (const char* name : {"--lifter", "--calib", "--camera", "--out"}) sub->get_option(name)->required();
  registry.Add(sub, "avatar lift apply", [options](CommandContext&) { return Describe(stages::RunLiftApply(*options)); });
}

}  // namespace

void RegisterAvatarLift(CLI::App& avatar, Registry& registry) {
  CLI::App* lift = avatar.add_subcommand("lift", "3D joints from video of a single camera");
  lift->require_subcommand(1);
  RegisterTrain(*lift, registry);
  RegisterApply(*lift, registry);
}

}  // namespace mvstudio::cli
