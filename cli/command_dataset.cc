#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>

#include "cli/commands.h"
#include "core/error.h"
#include "dataset/build.h"
#include "dataset/panoptic.h"
#include "dataset/verify.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct BuildArguments {
  std::string calib, pose3d, out;
  std::vector<std::string> video, images, plate;
  dataset::BuildOptions options;
};

struct VerifyArguments {
  std::string folder, keep;
  dataset::VerifyOptions options;
};

dataset::BuildInputs ToInputs(const BuildArguments& arguments) {
  dataset::BuildInputs inputs;
  inputs.calibration = arguments.calib;
  inputs.pose3d = arguments.pose3d;
  const auto add = [&inputs](const std::string& flag, const std::vector<std::string>& words) {
    for (const std::string& word : words) {
      const auto [camera, path] = SplitNamePath(flag, word);
      inputs.footage.push_back({camera, path, ""});
    }
  };
  add("--video", arguments.video);
  add("--images", arguments.images);
  for (const std::string& word : arguments.plate) {
    const auto [camera, path] = SplitNamePath("--plate", word);
    const auto found =
        std::find_if(inputs.footage.begin(), inputs.footage.end(), [&](const auto& f) { return f.camera == camera; });
    if (found == inputs.footage.end()) throw UsageError("--plate " + word + ": camera " + camera + " has no footage");
    found->plate = path;
  }
  return inputs;
}

ordered_json MaskMetrics(const dataset::BuildReport& report) {
  double area = 0;
  int joints = 0, on_mask = 0, supported = 0;
  for (const dataset::BuiltCamera& c : report.cameras) {
    area += c.mean_area_fraction / static_cast<double>(report.cameras.size());
    joints += c.joints, on_mask += c.joints_on_mask, supported += c.joints_supported;
  }
  const double n = std::max(joints, 1);
  return {{"mean_area_fraction", area}, {"joints_on_mask", on_mask / n}, {"joints_supported", supported / n}};
}

ordered_json CameraMetrics(const dataset::BuildReport& report) {
  ordered_json list = ordered_json::array();
  for (const dataset::BuiltCamera& c : report.cameras) {
    const double n = std::max(c.joints, 1);
    list.push_back({{"name", c.name},
                    {"alias", c.alias},
                    {"images", c.images},
                    {"size_rule", c.size_rule},
                    {"background_known", c.background_known},
                    {"mean_area_fraction", c.mean_area_fraction},
                    {"joints_on_mask", c.joints_on_mask / n},
                    {"joints_supported", c.joints_supported / n}});
  }
  return list;
}

CommandResult RunBuild(const BuildArguments& arguments, CommandContext& context) {
  const auto start = std::chrono::steady_clock::now();
  const dataset::BuildInputs inputs = ToInputs(arguments);
  const dataset::BuildReport report = dataset::BuildDataset(inputs, arguments.out, arguments.options, context.run);
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  CommandResult result;
  result.metrics = {{"cameras", report.cameras.size()}, {"frames", report.frames}, {"images", report.images}};
  if (arguments.options.masks) result.metrics["masks"] = MaskMetrics(report);
  result.metrics["per_camera"] = CameraMetrics(report);
  result.metrics["wall_s"] = wall_s;
  for (const dataset::BuildWarning& w : report.warnings) result.warnings.push_back({w.code, w.text, w.hint});
  result.outputs.push_back({arguments.out, "dataset"});
  result.outputs.push_back(
      {(std::filesystem::path(arguments.out) / ("calibration_" + report.sequence + ".json")).string(), "calibration"});
  result.folder = arguments.out;
  result.inputs = {arguments.calib, arguments.pose3d};
  for (const dataset::CameraFootage& f : inputs.footage) result.inputs.push_back(f.path);
  char text[160];
  std::snprintf(text, sizeof(text), "%s: %zu cameras, %d frames, %d pictures in %.1f s\n", arguments.out.c_str(),
                report.cameras.size(), report.frames, report.images, wall_s);
  result.text = text;
  for (const dataset::BuiltCamera& c : report.cameras) {
    std::snprintf(text, sizeof(text), "  %s (%s): person on %.1f %% of the picture, colours support %d of %d joints\n",
                  c.name.c_str(), c.alias.c_str(), 100 * c.mean_area_fraction, c.joints_supported, c.joints);
    if (arguments.options.masks) result.text += text;
  }
  return result;
}

CommandResult RunVerify(const VerifyArguments& arguments, CommandContext& context) {
  const dataset::VerifyReport report = dataset::VerifyDataset(arguments.folder, arguments.options, context.run);
  CommandResult result;
  result.inputs = {arguments.folder};
  result.folder = arguments.keep;
  result.metrics = {{"num_errors", report.num_errors()}, {"num_warnings", report.num_warnings()}};
  result.metrics["findings"] = ordered_json::array();
  for (const dataset::Finding& f : report.findings) {
    const bool error = f.severity == dataset::Finding::Severity::kError;
    result.metrics["findings"].push_back(
        {{"severity", error ? "error" : "warning"}, {"code", f.code}, {"path", f.path}, {"text", f.text}});
    (error ? result.errors : result.warnings).push_back({f.code, f.path + ": " + f.text, ""});
    result.text += std::string(error ? "error   " : "warning ") + f.code + " " + f.path + ": " + f.text + "\n";
  }
  result.metrics["cameras"] = report.cameras;
  result.metrics["frames"] = report.frames;
  result.metrics["pictures"] = report.pictures;
  result.metrics["masks"] = report.masks;
  result.text += std::to_string(report.cameras) + " cameras, " + std::to_string(report.frames) +
                 " frames: " + std::to_string(report.num_errors()) + " errors, " + std::to_string(report.num_warnings()) +
                 " warnings\n";
  if (report.num_errors() > 0) result.exit = kExitQualityGate;
  return result;
}

CommandResult RunInfo(const std::string& folder) {
  const dataset::PanopticDataset dataset = dataset::OpenPanopticDataset(folder);
  CommandResult result;
  result.inputs = {folder};
  int people = 0;
  for (const auto& [frame, poses] : dataset.poses) people = std::max(people, static_cast<int>(poses.size()));
  result.metrics = {{"sequence", dataset.sequence},        {"cameras", dataset.rig.cameras.size()},
                    {"frames", dataset.frames.size()},     {"first_frame", dataset.frames.front()},
                    {"last_frame", dataset.frames.back()}, {"most_people", people}};
  result.metrics["camera_list"] = ordered_json::array();
  result.text = "sequence " + dataset.sequence + ", frames " + std::to_string(dataset.frames.front()) + " to " +
                std::to_string(dataset.frames.back()) + " (" + std::to_string(dataset.frames.size()) + "), " +
                std::to_string(people) + " people at most\n";
  for (const auto& c : dataset.rig.cameras) {
    std::string alias;
    for (const auto& [from, to] : dataset.aliases) {
      if (to == c.camera.name) alias = from;
    }
    const std::string model(geometry::ToString(c.camera.model));
    result.metrics["camera_list"].push_back({{"name", c.camera.name},
                                             {"alias", alias},
                                             {"width", c.camera.width_px},
                                             {"height", c.camera.height_px},
                                             {"model", model}});
    result.text += "  " + c.camera.name + (alias.empty() ? "" : " (" + alias + ")") + " " + std::to_string(c.camera.width_px) +
                   "x" + std::to_string(c.camera.height_px) + " " + model + "\n";
  }
  return result;
}

void RegisterBuild(CLI::App* dataset, Registry& registry) {
  auto arguments = std::make_shared<BuildArguments>();
  CLI::App* sub =
      dataset->add_subcommand("build", "Footage, calibration and 3D joints -> dataset in CMU Panoptic layout, with masks");
  sub->add_option("--calib", arguments->calib, "calibration.json, ours or Panoptic's")->required();
  sub->add_option("--video", arguments->video, "CAMERA=FILE, once a camera")->allow_extra_args(true);
  sub->add_option("--images", arguments->images,
                  "CAMERA=FOLDER or CAMERA=PATTERN; the number in a picture's name is its frame");
  sub->add_option("--plate", arguments->plate, "CAMERA=FILE: picture of the empty scene");
  sub->add_option("--pose3d", arguments->pose3d, "folder with points.csv, as triangulate writes it")->required();
  sub->add_option("--out", arguments->out, "new folder")->required();
  AddOptions(sub, arguments->options);
  registry.Add(sub, "dataset build", [arguments](CommandContext& context) { return RunBuild(*arguments, context); });
}

}  // namespace

void RegisterDataset(CLI::App& app, Registry& registry) {
  CLI::App* dataset = app.add_subcommand("dataset", "Build, check and describe datasets in CMU Panoptic layout");
  dataset->require_subcommand(1);
  RegisterBuild(dataset, registry);

  auto arguments = std::make_shared<VerifyArguments>();
  CLI::App* verify = dataset->add_subcommand("verify", "List everything that is wrong with a dataset folder");
  verify->add_option("folder", arguments->folder, "dataset folder")->required();
  verify->add_option("--keep", arguments->keep,
                     "folder that keeps the findings for the report; the dataset itself is only read");
  AddOptions(verify, arguments->options);
  registry.Add(verify, "dataset verify", [arguments](CommandContext& context) { return RunVerify(*arguments, context); });

  auto folder = std::make_shared<std::string>();
  CLI::App* info = dataset->add_subcommand("info", "Describe a dataset folder");
  info->add_option("folder", *folder, "dataset folder")->required();
  registry.Add(info, "dataset info", [folder](CommandContext&) { return RunInfo(*folder); });
}

}  // namespace mvstudio::cli
