#include "cli/calib/calib.h"
#include "cli/program/options.h"
#include "stages/calib_files/describe.h"

namespace mvstudio::cli {

void RegisterCalibLenses(CLI::App& calib, Registry& registry) {
  CLI::App* lenses = calib.add_subcommand("lenses", "A library of calibrated lenses, for calibrate --lenses");
  lenses->require_subcommand(1);
  const auto added = std::make_shared<stages::LensAddOptions>();
  CLI::App* add = lenses->add_subcommand("add", "Add the lens of a calibrated camera to a library, which is made if need be");
  AddOutput(add, "LIBRARY", added->library, OutputKind::kFile, "library: a file")->required();
  AddOption(add, "CALIB", added->calibration, "calibration with the camera")->required();
  AddOptions(add, *added);
  add->get_option("--camera")->required();
  add->get_option("--serial")->required();
  registry.Add(add, "calib lenses add", [added](CommandContext&) { return Describe(stages::RunLensAdd(*added)); });
  const auto library = std::make_shared<std::string>();
  CLI::App* list = lenses->add_subcommand("list", "Print the lenses of a library");
  AddOption(list, "LIBRARY", *library, "library: a file")->required();
  registry.Add(list, "calib lenses list",
               [library](CommandContext&) { return Describe(stages::RunLensList(*library, false)); });
  CLI::App* check =
      lenses->add_subcommand("check", "Check the lenses of a library: implausible ones, those without covariance");
  AddOption(check, "LIBRARY", *library, "library: a file")->required();
  registry.Add(check, "calib lenses check",
               [library](CommandContext&) { return Describe(stages::RunLensList(*library, true)); });
}

}  // namespace mvstudio::cli
