#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/calibrate/describe.h"

namespace mvstudio::cli {

void RegisterCalibrate(CLI::App& app, Registry& registry) {
  auto options = std::make_shared<stages::CalibrateOptions>();
  CLI::App* sub = app.add_subcommand("calibrate", "Calibrate cameras from footage of a board, or from its corners");
  VisitFields(OptionAdder{sub}, *options);  // --overwrite joins the last subject
  sub->get_option("--lenses")->excludes("--start");
  registry.Add(sub, "calibrate", [options, sub](CommandContext& context) {
    options->given = GivenOptions(sub);
    return Describe(stages::RunCalibrate(*options, context.run));
  });
}

}  // namespace mvstudio::cli
