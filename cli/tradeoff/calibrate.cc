#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/tradeoff/describe.h"

namespace mvstudio::cli {

void RegisterTradeoffCalibrate(CLI::App& tradeoff, Registry& registry) {
  const auto options = std::make_shared<stages::CalibrateTradeoffOptions>();
  CLI::App* sub = tradeoff.add_subcommand(
      "calibrate", "Detector x number of boards x lens model x engine: seconds, held-out px, mm, and the Pareto front");
  AddOptions(sub, options->corners);
  AddOption(sub, "--detectors", options->detectors, "to compare")->delimiter(',')->capture_default_str();
  AddOption(sub, "--views", options->views, "time steps used; 0: all")->delimiter(',')->capture_default_str();
  AddOption(sub, "--models", options->models, "lens models, or auto")->delimiter(',')->capture_default_str();
  AddOption(sub, "--engines", options->engines, "mvstudio, mrcal")->delimiter(',')->capture_default_str();
  AddOutput(sub, "--out", options->out, OutputKind::kFolder, "folder for the table and the figure");
  registry.Add(sub, "tradeoff calibrate",
               [options](CommandContext& context) { return Describe(stages::RunCalibrateTradeoff(*options, context.run)); });
}

}  // namespace mvstudio::cli
