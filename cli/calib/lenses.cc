#include <algorithm>
#include <filesystem>

#include "cli/calib/calib.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/error.h"
#include "core/format.h"
#include "geometry/rig/plausible.h"
#include "geometry/rig/rig_io.h"
#include "stages/calib/lens_library.h"
#include "stages/input/calib_read.h"

namespace mvstudio::cli {
namespace {

struct AddArguments {
  std::string library, calibration, camera;
  stages::LensKey key;
  bool replace = false;
};

std::string Line(const geometry::RigCamera& lens) {
  const geometry::Camera& c = lens.camera;
  const double sigma = stages::SigmasOf(lens).focal_px;
  return Format("%-32s %-14s %5d x %-5d", c.name.c_str(), std::string(geometry::ToString(c.model)).c_str(), c.width_px,
                c.height_px) +
         Format(" %9.2f px  +- %s\n", (c.fx() + c.fy()) / 2, std::isfinite(sigma) ? Format("%.2f", sigma).c_str() : "?");
}

CommandResult Add(const AddArguments& arguments) {
  CommandResult result;
  const OutputFiles place({arguments.library}, {arguments.calibration});
  const calib::ImportedRig given = stages::ReadCalibrationFiles({arguments.calibration}, {});
  stages::AddNotes(given.notes, &result);
  result.inputs.push_back(arguments.calibration);
  const int camera = given.rig.Find(arguments.camera);
  if (camera < 0) throw UsageError("--camera " + arguments.camera + ": the calibration has no such camera");
  geometry::Rig library;
  if (std::filesystem::exists(arguments.library)) library = stages::ReadLensLibrary(arguments.library);
  stages::AddLens(given.rig.cameras[static_cast<size_t>(camera)], arguments.key, arguments.replace, &library);
  geometry::WriteRig(library, arguments.library);
  result.outputs.push_back({arguments.library, "lenses"});
  result.metrics["num_lenses"] = library.cameras.size();
  result.text = Line(library.cameras[static_cast<size_t>(library.Find(stages::LensName(arguments.key)))]);
  return result;
}

CommandResult List(const std::string& path) {
  CommandResult result;
  const geometry::Rig library = stages::ReadLensLibrary(path);
  result.inputs.push_back(path);
  stages::AddCameraMetrics(library, &result);
  for (const geometry::RigCamera& lens : library.cameras) result.text += Line(lens);
  return result;
}

/// Each lens by itself: a library has no poses to be doubted.
CommandResult Check(const std::string& path) {
  CommandResult result = List(path);
  for (const geometry::RigCamera& lens : stages::ReadLensLibrary(path).cameras) {
    geometry::Rig alone;
    alone.cameras = {lens};
    stages::AddImplausible(alone, &result);
    if (lens.params_covariance) continue;
    result.warnings.push_back({"CAL-COVARIANCE-MISSING", "lens " + lens.camera.name + " states no covariance",
                               "calibrate it again, or count its uncertainty as unknown"});
  }
  if (!result.warnings.empty()) result.exit = kExitQualityGate;
  return result;
}

}  // namespace

void RegisterCalibLenses(CLI::App& calib, Registry& registry) {
  CLI::App* lenses = calib.add_subcommand("lenses", "A library of calibrated lenses, for calibrate --lenses");
  lenses->require_subcommand(1);
  const auto added = std::make_shared<AddArguments>();
  CLI::App* add = lenses->add_subcommand("add", "Add the lens of a calibrated camera to a library, which is made if need be");
  AddOutput(add, "LIBRARY", added->library, OutputKind::kFile, "library: a file")->required();
  AddOption(add, "CALIB", added->calibration, "calibration with the camera")->required();
  AddOption(add, "--camera", added->camera, "its name in the calibration")->required();
  AddOption(add, "--serial", added->key.serial, "serial number, as mvstudio.toml has it")->required();
  AddOption(add, "--setting", added->key.setting, "how the lens is set: focal length, focus, resolution");
  AddFlag(add, "--replace", added->replace, "replace the lens of that serial number and setting");
  registry.Add(add, "calib lenses add", [added](CommandContext&) { return Add(*added); });
  const auto library = std::make_shared<std::string>();
  CLI::App* list = lenses->add_subcommand("list", "Print the lenses of a library");
  AddOption(list, "LIBRARY", *library, "library: a file")->required();
  registry.Add(list, "calib lenses list", [library](CommandContext&) { return List(*library); });
  CLI::App* check =
      lenses->add_subcommand("check", "Check the lenses of a library: implausible ones, those without covariance");
  AddOption(check, "LIBRARY", *library, "library: a file")->required();
  registry.Add(check, "calib lenses check", [library](CommandContext&) { return Check(*library); });
}

}  // namespace mvstudio::cli
