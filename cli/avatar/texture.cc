#include <memory>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/disk/output.h"
#include "stages/dataset/studio_names.h"
#include "stages/nets/body_folder.h"
#include "stages/nets/texture/avatar_texture.h"

namespace mvstudio::cli {
namespace {

struct TextureArguments {
  std::string source, out;
  bool overwrite = false;
  double frame_rate_hz = 30;
  stages::TextureOptions options;
};

CommandResult RunTexture(const TextureArguments& arguments, CommandContext& context) {
  const stages::TextureSource source = stages::OpenTextureSource(arguments.source, arguments.options.dataset);
  context.camera_names = stages::StudioNames(source.data.root);
  CommandResult result;
  result.folder = arguments.out, result.inputs = {arguments.source, source.data.root};
  const OutputFolder place(arguments.out, result.inputs, stages::BodyFolder::Names());
  const stages::BodyFolder folder(arguments.out, arguments.overwrite);
  const stages::TextureResult made = stages::MakeTexture(source, arguments.options, context.run);
  result.metrics = stages::ToJson(made);
  result.text = stages::ToTable(made);
  body::TexturedPerson person = source.body;
  person.textures = made.textures;
  result.Add(stages::DescribeBodyFolder(arguments.out, folder.Write(person, arguments.frame_rate_hz)));
  return result;
}

}  // namespace

void RegisterAvatarTexture(CLI::App& avatar, Registry& registry) {
  auto a = std::make_shared<TextureArguments>();
  CLI::App* sub = avatar.add_subcommand("texture", "Make the colours of a fitted body anew");
  AddOption(
      sub, "source", a->source,
      "training run whose body gets them, or a fitted body, with --dataset. Only what was trained on, or what the body was "
      "fitted to, is looked at; a run's validation images score")
      ->required();
  AddOutput(sub, "--out", a->out, OutputKind::kFolder, "folder for the body")->required();
  AddOptions(sub, a->options);
  AddOption(sub, "--fps", a->frame_rate_hz, "frames a second of the motion in body.glb")->check(CLI::Range(0.1, 1000.0));
  AddFlag(sub, "--overwrite", a->overwrite, "replace an older body in --out");
  registry.Add(sub, "avatar texture", [a](CommandContext& context) { return RunTexture(*a, context); });
}

}  // namespace mvstudio::cli
