#include "cli/calib/calib.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "stages/compare/describe.h"

namespace mvstudio::cli {

void RegisterCalibCompare(CLI::App& calib, Registry& registry) {
  const auto options = std::make_shared<stages::CompareOptions>();
  CLI::App* sub = calib.add_subcommand("compare",
                                       "Difference of two calibrations: poses after the rigid motion that aligns them "
                                       "best, and projection in px");
  AddOption(sub, "A", options->rig, "calibration")->required();
  AddOption(sub, "B", options->reference, "reference calibration")->required();
  AddOptions(sub, *options);
  sub->get_option("--focus")->check(CLI::Range(0.01, 1.0));
  sub->get_option("--grid")->check(CLI::Range(2, 1000));
  AddReadOptions(sub, options->read);
  registry.Add(sub, "calib compare", [options](CommandContext&) { return Describe(stages::RunCompare(*options)); });
}

}  // namespace mvstudio::cli
