#include "cli/calib/calib.h"
#include "cli/program/options.h"
#include "stages/calib_files/describe.h"

namespace mvstudio::cli {

void RegisterCalibResize(CLI::App& calib, Registry& registry) {
  const auto options = std::make_shared<stages::CalibResizeOptions>();
  CLI::App* sub =
      calib.add_subcommand("resize", "Lenses for images of another resolution, or for a crop of the calibrated images");
  AddOption(sub, "CALIB", options->calibration, "calibration to change")->required();
  AddOptions(sub, *options);
  sub->get_option("--camera-size")->take_all();
  sub->get_option("--crop")->take_all();
  sub->get_option("--out")->required();
  registry.Add(sub, "calib resize", [options](CommandContext&) { return Describe(stages::RunCalibResize(*options)); });
}

}  // namespace mvstudio::cli
