#include "cli/calib/calib.h"
#include "cli/program/arguments.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "stages/align/describe.h"

namespace mvstudio::cli {

void RegisterCalibAlign(CLI::App& calib, Registry& registry) {
  const auto options = std::make_shared<stages::AlignOptions>();
  CLI::App* sub = calib.add_subcommand(
      "align", "Move a calibrated rig to another world: a board on the floor, the floor under people's feet, or known points");
  AddOption(sub, "CALIB", options->calibration, "calibration to move")->required();
  AddOptions(sub, *options);
  sub->get_option("--floor-board")->check(CLI::NonNegativeNumber);
  sub->get_option("--click-sigma-px")->check(CLI::PositiveNumber);
  sub->get_option("--out")->required();
  StartGroup(sub, "Reading the calibration");
  AddChoice(sub, "--from", options->read.from, "format of the calibration: auto, " + calib::CalibrationFormatNames())
      ->capture_default_str()
      ->type_name("FORMAT")
      ->check(OneOf(stages::CalibrationFormatChoices()));
  AddMeaningOptions(sub, options->read);
  registry.Add(sub, "calib align",
               [options](CommandContext& context) { return Describe(stages::RunAlign(*options, context.run)); });
}

}  // namespace mvstudio::cli
