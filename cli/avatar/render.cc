#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/dataset/studio_names.h"
#include "stages/nets/render/describe.h"

namespace mvstudio::cli {

void RegisterAvatarRender(CLI::App& avatar, Registry& registry) {
  auto options = std::make_shared<stages::AvatarRenderOptions>();
  CLI::App* sub = avatar.add_subcommand(
      "render", "New images of a trained avatar: any calibrated camera, other poses, or an orbiting camera");
  AddOption(sub, "run", options->run_folder, "folder of the training run (--out of `avatar train`)")->required();
  AddOptions(sub, *options);
  NameOutput(sub->get_option("--video"), OutputKind::kFile);
  registry.Add(sub, "avatar render", [options](CommandContext& context) {
    const avatar::RenderOptions& render = options->render;
    if (render.calib.empty())
      context.camera_names = stages::StudioNames(avatar::OpenRun(options->run_folder, render.dataset).dataset);
    return Describe(stages::RunAvatarRender(*options, context.run));
  });
}

}  // namespace mvstudio::cli
