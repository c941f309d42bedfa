#include <memory>

#include "avatar/maps/bone_lists.h"
#include "avatar/train/train.h"
#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/redact.h"
#include "stages/nets/avatar_pretrain.h"
#include "stages/nets/renderer_pretrain.h"

namespace mvstudio::cli {
namespace {

struct PretrainArguments {
  std::string out, motion, poses, body_template = "mannequin";
  stages::PretrainOptions options;
  bool overwrite = false;
};

CommandResult RunPretrain(const PretrainArguments& arguments, CommandContext& context) {
  Validate(arguments.options);
  avatar::ResolveDevice(arguments.options.train.device);
  const int num_joints = avatar::LayoutOf(arguments.options.model.inputs).num_joints;
  const stages::PretrainInput input =
      stages::ReadPretrainInput(arguments.motion, arguments.poses, arguments.body_template, num_joints);
  return Pretrain(input, arguments.options, arguments.out, arguments.overwrite, Redacting(), context.run);
}

struct RendererArguments {
  std::string out;
  stages::RendererPretraining pretraining;
  bool overwrite = false;
};

}  // namespace

void RegisterAvatarPretrainRenderer(CLI::App& avatar, Registry& registry) {
  auto a = std::make_shared<RendererArguments>();
  CLI::App* sub = avatar.add_subcommand("pretrain-renderer",
                                        "Train one renderer of method hf on several people, for `avatar train --init-from`");
  AddOption(sub, "runs", a->pretraining.runs,
            "folders of `avatar train --method hf`, one a person, with networks of one size; --steps 0 is enough")
      ->required();
  AddOutput(sub, "--out", a->out, OutputKind::kFolder, "folder of the renderer")->required();
  AddOptions(sub, a->pretraining);
  AddFlag(sub, "--overwrite", a->overwrite, "replace an older network in --out");
  registry.Add(sub, "avatar pretrain-renderer",
               [a](CommandContext& context) { return PretrainRenderer(a->pretraining, a->out, a->overwrite, context.run); });
}

void RegisterAvatarPretrain(CLI::App& avatar, Registry& registry) {
  auto a = std::make_shared<PretrainArguments>();
  CLI::App* sub = avatar.add_subcommand(
      "pretrain", "Teach a network parts and coordinates of bodies in random shapes and poses, for `avatar train --init-from`");
  StartGroup(sub, "Data");
  AddOutput(sub, "--out", a->out, OutputKind::kFolder, "folder of the network")->required();
  AddOption(sub, "--motion", a->motion, "animation files (Biovision hierarchy) and folders of them, with commas between");
  AddOption(sub, "--poses", a->poses,
            "datasets in Panoptic's layout whose 3D poses are learned from, with commas between; of DATASET:0-89+100-119 those "
            "frames alone, so that others can be tested on. Images are not needed");
  AddOption(sub, "--template", a->body_template,
            "bodies that are posed, as in `avatar fit`: mannequin, a path, several with commas between them, auto");
  AddOptions(sub, a->options);
  AddFlag(sub, "--overwrite", a->overwrite, "replace an older network in --out");
  registry.Add(sub, "avatar pretrain", [a](CommandContext& context) { return RunPretrain(*a, context); });
}

}  // namespace mvstudio::cli
