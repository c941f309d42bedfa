#include "cli/calib/calib.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "stages/calib_files/describe.h"

namespace mvstudio::cli {

void RegisterCalibShow(CLI::App& calib, Registry& registry) {
  const auto options = std::make_shared<stages::CalibShowOptions>();
  CLI::App* sub = calib.add_subcommand("show", "Print a calibration as a table");
  AddOption(sub, "IN", options->in, "calibration file or folder (opencv, mrcal, easymocap: several)")->required();
  AddReadOptions(sub, options->read);
  registry.Add(sub, "calib show", [options](CommandContext&) { return Describe(stages::RunCalibShow(*options)); });
}

}  // namespace mvstudio::cli
