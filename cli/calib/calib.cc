#include "cli/calib/calib.h"

#include "cli/program/commands.h"
#include "cli/program/options.h"

namespace mvstudio::cli {

void RegisterCalib(CLI::App& app, Registry& registry) {
  CLI::App* calib = app.add_subcommand("calib", "Convert, show, compare, check and move calibrations");
  calib->require_subcommand(1);
  RegisterCalibConvert(*calib, registry);
  RegisterCalibShow(*calib, registry);
  RegisterCalibCompare(*calib, registry);
  RegisterCalibEval(*calib, registry);
  RegisterCalibRefine(*calib, registry);
  RegisterCalibAlign(*calib, registry);
  RegisterCalibClick(*calib, registry);
  RegisterCalibResize(*calib, registry);
  RegisterCalibLenses(*calib, registry);
}

}  // namespace mvstudio::cli
