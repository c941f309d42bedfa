#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/body_template/describe.h"

/// `avatar template`, which does without libtorch.
namespace mvstudio::cli {

void RegisterAvatarTemplate(CLI::App& avatar, Registry& registry) {
  const auto options = std::make_shared<stages::BodyTemplateOptions>();
  CLI::App* sub =
      avatar.add_subcommand("template", "Tell what a body template holds; .pkl files as .npz, without running them");
  AddOption(sub, "source", options->source,
            "mannequin, a folder of MakeHuman's base mesh, rigs and targets, or a .npz or .pkl file in SMPL's layout")
      ->required();
  AddOutput(sub, "--out", options->out, OutputKind::kFile,
            "new .npz file in SMPL's layout, for --template and numpy; a file that exists is kept");
  registry.Add(sub, "avatar template", [options](CommandContext&) { return Describe(RunBodyTemplate(*options)); });
}

}  // namespace mvstudio::cli
