#include <chrono>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/format.h"
#include "dataset/import/panoptic_import.h"
#include "stages/dataset/dataset_report.h"

namespace mvstudio::cli {
namespace {

struct ImportArguments {
  std::string folder, out;
  dataset::PanopticImportOptions options;
};

CommandResult RunPanoptic(const ImportArguments& arguments, CommandContext& context) {
  const auto start = std::chrono::steady_clock::now();
  CommandResult result;
  const dataset::PanopticImportReport report =
      dataset::ImportPanoptic(arguments.folder, arguments.out, arguments.options, context.run);
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  result.inputs = {arguments.folder};
  result.folder = arguments.out;
  result.outputs.push_back({arguments.out, "session"});
  result.outputs.push_back({arguments.out + "/calib/calibration.json", "calibration"});
  result.metrics = {{"sequence", report.sequence},
                    {"takes", report.takes},
                    {"cameras", report.cameras},
                    {"cameras_with_footage", report.cameras_with_footage},
                    {"frames", report.frames},
                    {"first_frame", report.first_frame},
                    {"last_frame", report.last_frame},
                    {"most_people", report.most_people},
                    {"joints", report.joints},
                    {"faces", report.faces},
                    {"hands", report.hands},
                    {"pictures", report.pictures},
                    {"worst_clock_ms", FiniteOrNull(report.worst_clock_ms)},
                    {"wall_s", wall_s}};
  result.Add(stages::DescribeDatasetFindings(report.findings));
  if (!result.errors.empty()) result.exit = kExitPartial;
  const std::string joints = report.frames == 0 ? "no joints"
                                                : Format("joints of %d frames (%d to %d), %d people at most", report.frames,
                                                         report.first_frame, report.last_frame, report.most_people);
  result.text += arguments.out + Format(": %d cameras, %d with footage; %s; %d faces, %d hands files; %.1f s\n", report.cameras,
                                        report.cameras_with_footage, joints.c_str(), report.faces, report.hands, wall_s);
  if (report.cameras_with_footage == 0)
    result.warnings.push_back({"DAT-IMAGE", arguments.folder + ": holds no footage of any camera: calibration and joints alone",
                               "images belong in hdImgs/CAMERA, videos in hdVideos"});
  if (report.frames > 0 && report.most_people == 0) {
    result.exit = kExitQualityGate;
    result.errors.push_back(
        {"DAT-POSE", Format("%s: nobody is in any of the %d frames with joints", arguments.folder.c_str(), report.frames),
         "choose other --frames"});
  }
  return result;
}

}  // namespace

void RegisterDatasetImport(CLI::App& dataset, Registry& registry) {
  CLI::App* import = dataset.add_subcommand("import", "Turn another project's recordings into a session folder");
  import->require_subcommand(1);
  auto arguments = std::make_shared<ImportArguments>();
  CLI::App* sub = import->add_subcommand(
      "panoptic", "A CMU Panoptic sequence, or a folder in its layout -> session with calibration, joints, footage and times");
  AddOption(sub, "folder", arguments->folder, "folder with calibration_<sequence>.json")->required();
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder, "new session folder")->required();
  AddOptions(sub, arguments->options);
  registry.Add(sub, "dataset import panoptic",
               [arguments](CommandContext& context) { return RunPanoptic(*arguments, context); });
}

}  // namespace mvstudio::cli
