#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/body_mesh/describe.h"

/// `avatar mesh`, which does without libtorch.
namespace mvstudio::cli {

void RegisterAvatarMesh(CLI::App& avatar, Registry& registry) {
  const auto options = std::make_shared<stages::BodyMeshOptions>();
  CLI::App* sub = avatar.add_subcommand("mesh", "A fitted body as one OBJ mesh a frame, with its texture");
  AddOption(sub, "body", options->body, "fitted body: body.npz or the folder with it")->required();
  AddOutput(sub, "--out", options->out, OutputKind::kFolder, "new folder for FRAME_00000000.obj, …, body.mtl and body.png")
      ->required();
  AddOption(sub, "--frames", options->frames, "80-99 or 1,4,7-9, or all that the body has a pose of");
  AddFlag(sub, "--overwrite", options->overwrite, "replace the output folder");
  registry.Add(sub, "avatar mesh", [options](CommandContext&) { return Describe(RunBodyMesh(*options)); });
}

}  // namespace mvstudio::cli
