#include <algorithm>
#include <chrono>
#include <filesystem>

#include "cli/program/commands.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/format.h"
#include "core/some_of.h"
#include "dataset/build/build.h"
#include "dataset/build/scene_joints.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/markers.h"
#include "dataset/pose/pose3d.h"
#include "geometry/skeleton/skeleton.h"
#include "stages/input/mask_notice.h"
#include "stages/input/take_input.h"
#include "stages/people/human_shape.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct BuildArguments {
  stages::TakeArguments take;
  std::string calib, pose3d, marker_unit, skeleton, frames, masks, out;
  bool sequence_given = false, rate_given = false, masks_given = false, no_masks = false;
  dataset::BuildOptions options;
};

/// What `mask` doubted of a camera's masks: they follow the joints, so nothing here would notice it.
void RepeatDoubts(const std::string& masks, CommandResult* result) {
  const std::string path = masks + "/mask.result.json";
  if (!std::filesystem::exists(path)) return;
  const auto made = nlohmann::json::parse(ReadFile(path), nullptr, false);
  if (!made.is_object() || !made.contains("warnings") || !made["warnings"].is_array()) return;
  for (const auto& warning : made["warnings"]) {
    const auto word = [&](const char* key) {
      const auto at = warning.is_object() ? warning.find(key) : warning.end();
      return at != warning.end() && at->is_string() ? at->get<std::string>() : "";
    };
    const std::string code = word("code");
    if (code == "MSK-HULL" || code == "MSK-JOINTS" || code == "MSK-EMPTY")
      result->warnings.push_back({code, "of the masks in " + masks + ": " + word("text"), word("hint")});
  }
}

/// Masks that `mask` made, or a person painted, come before new ones.
void FindMasks(const stages::TakeInput& take, BuildArguments* arguments, CommandResult* result) {
  arguments->options.masks = !arguments->no_masks;
  if (arguments->no_masks) return arguments->masks.clear();
  const std::string made = take.Folder("masks");
  const bool there = !made.empty() && std::any_of(take.footage.begin(), take.footage.end(), [&](const auto& footage) {
    return std::filesystem::is_directory(made + "/" + footage.camera);
  });
  if (!arguments->masks_given && there) arguments->masks = made;
  if (arguments->masks.empty()) return;
  result->inputs.push_back(arguments->masks);
  RepeatDoubts(arguments->masks, result);
}

/// Inputs; what a session says takes the place of flags that were not given.
dataset::BuildInputs ToInputs(BuildArguments* arguments, CommandResult* result) {
  stages::TakeInput take = stages::ReadTakeInput(arguments->take, result);
  if (take.footage.empty()) throw UsageError("no footage: give --video or --images for each camera, or --session");
  dataset::BuildInputs inputs;
  inputs.calibration = arguments->calib.empty() ? take.calibration : arguments->calib;
  if (inputs.calibration.empty()) throw UsageError("--calib is needed: the calibration of these cameras");
  inputs.pose3d = arguments->pose3d.empty() ? take.Folder("pose3d") : arguments->pose3d;
  inputs.marker_unit = arguments->marker_unit, inputs.skeleton = arguments->skeleton;
  if (!arguments->frames.empty()) inputs.frames = ParseRanges("--frames", arguments->frames);
  if (inputs.pose3d.empty()) throw UsageError("--pose3d is needed: the folder that triangulate wrote");
  if (arguments->out.empty()) arguments->out = take.Folder("dataset");
  if (arguments->out.empty()) throw UsageError("--out is needed without --session");
  if (!arguments->sequence_given && !take.take.empty()) arguments->options.sequence = dataset::Slug(take.take);
  if (!arguments->rate_given) {
    const bool scenes = !dataset::SceneFilesAt(inputs.pose3d).empty();
    const double stated_hz = take.fps_hz > 0 ? take.fps_hz
                             : scenes        ? dataset::ReadSceneJoints(inputs.pose3d).frame_rate_hz
                                             : dataset::ReadPoints3d(inputs.pose3d, inputs.marker_unit).frame_rate_hz;
    if (stated_hz > 0) arguments->options.frame_rate_hz = stated_hz;
  }
  stages::LeaveOutUncalibrated(inputs.calibration, &take, result);
  FindMasks(take, arguments, result);
  inputs.masks = arguments->masks;
  inputs.footage = std::move(take.footage);
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

/// Joints that were triangulated before the rig was moved may still be in view.
void CheckWorld(const dataset::BuildInputs& inputs, const dataset::BuildReport& report, CommandResult* result) {
  const std::string world = stages::WorldText(dataset::ReadAnyCalibration(inputs.calibration));
  if (report.world == dataset::kZUpWorld || report.world == world) return;
  result->warnings.push_back(
      {"DAT-WORLD",
       inputs.pose3d + " states another world (" + report.world + ") than " + inputs.calibration + " (" + world + ")",
       "triangulate again with this calibration"});
}

CommandResult RunBuild(BuildArguments arguments, CommandContext& context) {
  const auto start = std::chrono::steady_clock::now();
  CommandResult result;
  const dataset::BuildInputs inputs = ToInputs(&arguments, &result);
  const dataset::BuildReport report = dataset::BuildDataset(inputs, arguments.out, arguments.options, context.run);
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  result.metrics = {{"cameras", report.cameras.size()}, {"frames", report.frames}, {"images", report.images}};
  if (arguments.options.masks) result.metrics["masks"] = MaskMetrics(report);
  result.metrics["per_camera"] = CameraMetrics(report);
  result.metrics["joints_beside"] = report.joints_beside;
  result.metrics["skeleton"] = report.skeleton.empty() ? "coco19" : report.skeleton;
  if (!report.marker_unit.empty()) result.metrics["markers"] = {{"unit", report.marker_unit}, {"up", report.marker_up}};
  result.metrics["wall_s"] = wall_s;
  if (report.calibration_offset_frames > 0)
    result.metrics["calibration_offsets"] = {{"applied", false},
                                             {"largest_frames", report.calibration_offset_frames},
                                             {"reason", "images are taken whole; a timeline of the take is what chooses them"}};
  result.metrics["masks_from"] = !arguments.options.masks ? "none" : inputs.masks.empty() ? "made" : inputs.masks;
  Append(report.warnings, &result.warnings);
  CheckWorld(inputs, report, &result);
  result.outputs.push_back({arguments.out, "dataset"});
  result.outputs.push_back(
      {(std::filesystem::path(arguments.out) / ("calibration_" + report.sequence + ".json")).string(), "calibration"});
  result.folder = arguments.out;
  result.inputs.insert(result.inputs.end(), {inputs.calibration, inputs.pose3d});
  if (geometry::IsSkeletonFile(inputs.skeleton)) result.inputs.push_back(inputs.skeleton);
  const auto lacks_masks = [](const dataset::BuiltCamera& c) { return !c.without_mask.empty(); };
  if (!report.gaps.empty() || std::any_of(report.cameras.begin(), report.cameras.end(), lacks_masks))
    result.exit = kExitPartial;
  if (report.images == 0) {
    result.exit = kExitBadInput;
    result.errors.push_back(
        {"DAT-INSTANTS", "no camera has an image of any time step with joints",
         "do the frame numbers in " + inputs.pose3d + " count the take's time steps? see session timeline"});
  }
  result.text = Format("%s: %zu cameras, %d frames, %d images in %.1f s\n", arguments.out.c_str(), report.cameras.size(),
                       report.frames, report.images, wall_s);
  if (!report.marker_unit.empty())
    result.text += "  3D joints of " + inputs.pose3d + ": " + report.marker_unit + ", " + report.marker_up + " up\n";
  if (!report.skeleton.empty()) {
    result.text += Format("  %zu joints beside Panoptic's 19: ", report.joints_beside.size()) + SomeOf(report.joints_beside) +
                   "; all joints of " + report.skeleton + " are in hdPose3d_stage1_" + report.skeleton + "\n";
  }
  if (!inputs.masks.empty()) {
    result.text += Format("  %d masks of ", report.given_masks) + inputs.masks + " (--masks alone makes new ones)\n";
    stages::TellMasks(report.masks, inputs.masks, &result);
    return result;
  }
  for (const dataset::BuiltCamera& c : report.cameras) {
    if (arguments.options.masks && c.joints == 0)
      result.text += Format("  %s (%s): no joint of Panoptic's 19 in view, so its masks are empty or uncertain\n",
                            c.name.c_str(), c.alias.c_str());
    else if (arguments.options.masks)
      result.text += Format("  %s (%s): person on %.1f %% of the image, colours support %d of %d joints\n", c.name.c_str(),
                            c.alias.c_str(), 100 * c.mean_area_fraction, c.joints_supported, c.joints);
  }
  return result;
}

void RegisterBuild(CLI::App* dataset, Registry& registry) {
  auto arguments = std::make_shared<BuildArguments>();
  CLI::App* sub =
      dataset->add_subcommand("build", "Footage, calibration and 3D joints -> dataset in CMU Panoptic layout, with masks");
  StartGroup(sub, "Calibration and 3D joints");
  AddOption(sub, "--calib", arguments->calib, "calibration.json, ours or Panoptic's; default: the session's");
  AddTakeArguments(sub, arguments->take);
  AddOption(sub, "--pose3d", arguments->pose3d,
            "folder with points.csv, as triangulate writes it, a dataset or folder of body3DScene_*.json, or a file of "
            "markers; the session's pose3d/TAKE "
            "unless given");
  AddOption(sub, "--frames", arguments->frames, "80-99 or 1,4,7-9: time steps of the joints; all unless given");
  AddOption(sub, "--marker-unit", arguments->marker_unit,
            "m, cm, mm, in or the length of one unit, e.g. 25mm: instead of what the file of markers states");
  AddSkeletonOption(sub, arguments->skeleton, "of the 3D joints, where --pose3d does not state it");
  StartGroup(sub, "Dataset");
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder, "new folder; the session's dataset/TAKE unless given");
  AddOption(sub, "--masks", arguments->masks,
            "folder with a folder of masks for each camera, named by frame; alone: make masks. The session's masks/TAKE, "
            "where it is there, unless given")
      ->expected(0, 1)
      ->type_name("DIR");
  AddFlag(sub, "--no-masks", arguments->no_masks, "no masks");
  AddOptions(sub, arguments->options);
  registry.Add(sub, "dataset build", [arguments, sub](CommandContext& context) {
    arguments->sequence_given = sub->count("--sequence") > 0, arguments->rate_given = sub->count("--frame-rate") > 0;
    arguments->masks_given = sub->count("--masks") > 0;
    return RunBuild(*arguments, context);
  });
}

}  // namespace

void RegisterDataset(CLI::App& app, Registry& registry) {
  CLI::App* dataset = app.add_subcommand("dataset", "Build, check and describe datasets in CMU Panoptic layout");
  dataset->require_subcommand(1);
  RegisterBuild(dataset, registry);
  RegisterDatasetImport(*dataset, registry);
  RegisterDatasetPack(*dataset, registry);
  RegisterDatasetSplit(*dataset, registry);
  RegisterDatasetExport(*dataset, registry);
  RegisterDatasetVerify(*dataset, registry);
}

}  // namespace mvstudio::cli
