#include "cli/calib/calib.h"
#include "cli/program/options.h"
#include "cli/program/show_page.h"
#include "stages/click/describe.h"

namespace mvstudio::cli {

void RegisterCalibClick(CLI::App& calib, Registry& registry) {
  const auto options = std::make_shared<stages::ClickOptions>();
  CLI::App* sub = calib.add_subcommand(
      "click", "Click points in the cameras' images, in a browser on this machine, for calibrate --scene-points");
  AddOptions(sub, *options);
  sub->get_option("--points")->required();
  sub->get_option("--frame")->check(CLI::NonNegativeNumber);
  sub->get_option("--port")->check(CLI::Range(0, 65535));
  sub->get_option("--click-sigma-px")->check(CLI::PositiveNumber);
  registry.Add(sub, "calib click", [options](CommandContext& context) {
    return Describe(stages::RunClick(*options, ShowOn(options->port, "its button Finish"), context.run));
  });
}

}  // namespace mvstudio::cli
