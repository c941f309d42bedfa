#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/overlay/describe.h"

namespace mvstudio::cli {

void RegisterRender(CLI::App& app, Registry& registry) {
  CLI::App* render = app.add_subcommand("render", "Draw what was found over the footage");
  render->require_subcommand(1);
  const auto options = std::make_shared<stages::OverlayOptions>();
  CLI::App* sub = render->add_subcommand(
      "overlay", "Footage with joints, residuals, masks, boards and the body drawn over it, as videos and a contact sheet");
  AddOption(sub, "PATH", options->scene.path, "folder of a session, a dataset or a run; or points in 3D (.trc, .c3d)")
      ->required();
  AddOptions(sub, *options);
  sub->get_option("--out")->required();
  registry.Add(sub, "render overlay",
               [options](CommandContext& context) { return Describe(stages::RunOverlay(*options, context.run)); });
}

}  // namespace mvstudio::cli
