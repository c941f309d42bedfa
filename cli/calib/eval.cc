#include "cli/calib/calib.h"
#include "cli/program/arguments.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "stages/eval/describe.h"

namespace mvstudio::cli {

void RegisterCalibEval(CLI::App& calib, Registry& registry) {
  const auto options = std::make_shared<stages::EvalOptions>();
  CLI::App* sub = calib.add_subcommand(
      "eval", "Check a calibration on new footage of a board: has a camera been bumped, which one, how far");
  AddOption(sub, "CALIB", options->calibration, "calibration to check; that of --session unless given");
  AddOptions(sub, *options);
  StartGroup(sub, "Reading the calibration");
  AddChoice(sub, "--from", options->read.from, "format of the calibration: auto, " + calib::CalibrationFormatNames())
      ->capture_default_str()
      ->type_name("FORMAT")
      ->check(OneOf(stages::CalibrationFormatChoices()));
  AddChoice(sub, "--unit", options->read.unit, "unit of length of files that name none")
      ->capture_default_str()
      ->check(OneOf({"m", "cm", "mm", "in"}));
  AddMeaningOptions(sub, options->read);
  registry.Add(sub, "calib eval",
               [options](CommandContext& context) { return Describe(stages::RunEval(*options, context.run)); });
}

}  // namespace mvstudio::cli
