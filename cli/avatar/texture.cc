#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/dataset/studio_names.h"
#include "stages/nets/texture/run.h"

namespace mvstudio::cli {

void RegisterAvatarTexture(CLI::App& avatar, Registry& registry) {
  auto a = std::make_shared<stages::TextureRunOptions>();
  CLI::App* sub = avatar.add_subcommand("texture", "Make the colours of a fitted body anew");
  AddOption(
      sub, "source", a->source,
      "training run whose body gets them, or a fitted body, with --dataset. Only what was trained on, or what the body was "
      "fitted to, is looked at; a run's validation images score")
      ->required();
  AddOutput(sub, "--out", a->out, OutputKind::kFolder, "folder for the body")->required();
  AddOptions(sub, a->how);
  AddOption(sub, "--fps", a->frame_rate_hz, "frames a second of the motion in body.glb")->check(CLI::Range(0.1, 1000.0));
  AddFlag(sub, "--overwrite", a->overwrite, "replace an older body in --out");
  registry.Add(sub, "avatar texture", [a](CommandContext& context) {
    const stages::TextureSource source = stages::OpenTextureSource(a->source, a->how.dataset);
    context.camera_names = stages::StudioNames(source.data.root);
    return Describe(RunTexture(source, *a, context.run));
  });
}

}  // namespace mvstudio::cli
