#include "dataset/exports/export.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "dataset/panoptic/sequence.h"
#include "stages/input/mask_notice.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct Arguments {
  std::string folder, to, out, frames;
  exports::ExportOptions options;
};

exports::ExportOptions OptionsOf(const Arguments& arguments) {
  exports::ExportOptions options = arguments.options;
  options.cameras = SplitCommas(Join(options.cameras, ","));  // "00_00,00_03" and repeated flags alike
  options.all_frames = arguments.frames == "all";
  if (!arguments.frames.empty() && !options.all_frames) options.frames = ParseRanges("--frames", arguments.frames);
  return options;
}

ordered_json Metrics(const exports::ExportReport& report) {
  ordered_json metrics = {{"format", report.format},
                          {"num_cameras", report.cameras.size()},
                          {"num_frames", report.frames.size()},
                          {"people", report.people},
                          {"pictures", report.pictures},
                          {"masks", report.masks},
                          {"points", report.points},
                          {"linked", report.linked},
                          {"missing_pictures", report.missing_pictures},
                          {"missing_masks", report.missing_masks}};
  metrics["missing"] = ordered_json::parse(dataset::MissingToJsonText(report.missing));
  for (const auto& [name, value] : report.figures) metrics[name] = FiniteOrNull(value);
  metrics["cameras"] = ordered_json::array();
  for (const exports::ExportedCamera& camera : report.cameras) {
    metrics["cameras"].push_back({{"name", camera.name},
                                  {"dataset_name", camera.source},
                                  {"studio_name", camera.studio},
                                  {"undistorted", camera.undistorted},
                                  {"lost_share", FiniteOrNull(camera.lost_share)}});
  }
  return metrics;
}

/// Cameras and joints of a folder without pictures, as Panoptic's sequences are before their videos are fetched.
dataset::PanopticDataset OpenWithoutPictures(const std::string& root) {
  dataset::PanopticDataset dataset;
  dataset.root = root;
  const std::string calibration = dataset::FindPanopticCalibration(root);
  dataset.sequence = std::filesystem::path(calibration).stem().string().substr(std::string("calibration_").size());
  dataset.rig = dataset::ReadPanopticCalibration(calibration);
  dataset.aliases = dataset::ReadPanopticAliases(root);
  dataset::ReadJoints(&dataset);
  return dataset;
}

dataset::PanopticDataset Open(const Arguments& arguments) {
  const bool wants_pictures =
      exports::FormatByName(arguments.to).has_pictures && arguments.options.pictures != exports::ExportPictures::kNone;
  const bool has_pictures = std::filesystem::exists(arguments.folder + "/hdImgs");
  return wants_pictures || has_pictures ? dataset::OpenPanopticDataset(arguments.folder)
                                        : OpenWithoutPictures(arguments.folder);
}

CommandResult Export(Arguments arguments, CommandContext& context) {
  const bool file = exports::IsDatasetFile(exports::FormatByName(arguments.to), arguments.out);
  if (!file) arguments.out = OutputName(arguments.out, OutputKind::kFolder);
  const exports::ExportOptions options = OptionsOf(arguments);
  const dataset::PanopticDataset dataset = Open(arguments);
  const exports::ExportReport report = exports::ExportDataset(dataset, arguments.to, arguments.out, options, context.run);
  CommandResult result;
  result.inputs = {arguments.folder};
  if (!options.split.empty()) result.inputs.push_back(options.split);
  result.folder = file ? std::filesystem::path(PathOnDisk(arguments.out)).parent_path().string() : arguments.out;
  result.outputs.push_back({arguments.out, "export"});
  constexpr size_t kFewFiles = 20;
  for (size_t i = 0; !file && i < std::min(report.files.size(), kFewFiles); ++i) {
    result.outputs.push_back({arguments.out + "/" + report.files[i], "export-file"});
  }
  result.metrics = Metrics(report);
  Append(report.notes, &result.warnings);
  result.text = arguments.out + Format(": %zu cameras, %zu frames, %d people, %d images, %d masks, %d points (%s)\n",
                                       report.cameras.size(), report.frames.size(), report.people, report.pictures,
                                       report.masks, report.points, arguments.to.c_str());
  if (report.masks > 0) stages::TellMasks(dataset.Masks(), arguments.folder + "/masks", &result);
  if (report.missing_pictures > 0) result.exit = kExitPartial;
  if (report.people == 0 && report.pictures == 0) {
    result.exit = kExitQualityGate;
    result.errors.push_back({"EXP-NOBODY", "the chosen frames hold nobody's joints and no image: cameras alone were written",
                             "choose other --frames"});
  }
  return result;
}

std::string FormatList() { return Join(exports::Formats(), ", ", &exports::FormatInfo::name); }

}  // namespace

void RegisterDatasetExport(CLI::App& dataset, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = dataset.add_subcommand("export", "Write a dataset for the program that is to read it (docs/exports.md)");
  AddOption(sub, "folder", arguments->folder, "dataset folder")->required();
  AddOption(sub, "--to", arguments->to, "format: " + FormatList())->required()->type_name("FORMAT");
  AddOutput(sub, "--out", arguments->out, OutputKind::kAny,
            "new folder; of csv, npz and gltf also the file alone, where the name ends in .csv, .npz or .glb")
      ->required();
  AddOption(sub, "--cameras", arguments->options.cameras, "only these, of either name, separated by commas; default: all")
      ->take_all();
  AddOption(sub, "--frames", arguments->frames,
            "80-99 or 1,4,7-9, or all; default: the first for formats of one time step (colmap, nerfstudio), else all");
  AddOption(sub, "--split", arguments->options.split,
            "split file: its cameras and frames, train and test where the format has them");
  AddOptions(sub, arguments->options);
  registry.Add(sub, "dataset export", [arguments](CommandContext& context) { return Export(*arguments, context); });
}

}  // namespace mvstudio::cli
