#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/nets/texture/run.h"

namespace mvstudio::cli {

void RegisterAvatarEdit(CLI::App& avatar, Registry& registry) {
  auto a = std::make_shared<stages::EditOptions>();
  CLI::App* sub = avatar.add_subcommand("edit", "Change the colours or the shape of a fitted body by hand");
  AddOption(sub, "body", a->body, "fitted body: body.npz or the folder with it")->required();
  AddOutput(sub, "--out", a->out, OutputKind::kFolder, "folder for the changed body")->required();
  AddOption(sub, "--picture", a->image,
            "its texture.png after a paint program, of the same size, or with charts of a multiple of theirs");
  AddOption(
      sub, "--shape", a->shape,
      "what is added to its shape, NAME=NUMBER,...: trunk, head, arm, leg (girths: 0.1 is a tenth thicker), and the blend "
      "shapes of --template in its units");
  AddOption(sub, "--template", a->body_template, "what the body was fitted to, for its blend shapes");
  AddOption(sub, "--fps", a->frame_rate_hz, "frames a second of the motion in body.glb")->check(CLI::Range(0.1, 1000.0));
  AddFlag(sub, "--overwrite", a->overwrite, "replace an older body in --out");
  registry.Add(sub, "avatar edit", [a](CommandContext&) { return Describe(stages::RunEdit(*a)); });
}

}  // namespace mvstudio::cli
