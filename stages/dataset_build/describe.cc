#include "stages/dataset_build/describe.h"

#include <algorithm>
#include <filesystem>

#include "core/format.h"
#include "core/some_of.h"
#include "geometry/skeleton/skeleton.h"
#include "stages/input/mask_notice.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

ordered_json BuiltMaskJson(const dataset::BuildReport& report) {
  double area = 0;
  int joints = 0, on_mask = 0, supported = 0;
  for (const dataset::BuiltCamera& c : report.cameras) {
    area += c.mean_area_fraction / static_cast<double>(report.cameras.size());
    joints += c.joints, on_mask += c.joints_on_mask, supported += c.joints_supported;
  }
  const double n = std::max(joints, 1);
  return {{"mean_area_fraction", area}, {"joints_on_mask", on_mask / n}, {"joints_supported", supported / n}};
}

ordered_json BuiltCamerasJson(const dataset::BuildReport& report) {
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

ordered_json BuildMetrics(const DatasetBuildReport& report) {
  const dataset::BuildReport& built = report.built;
  const bool masks = report.options.build.masks;
  ordered_json m = {{"cameras", built.cameras.size()}, {"frames", built.frames}, {"images", built.images}};
  if (masks) m["masks"] = BuiltMaskJson(built);
  m["per_camera"] = BuiltCamerasJson(built);
  m["joints_beside"] = built.joints_beside;
  m["skeleton"] = built.skeleton.empty() ? "coco19" : built.skeleton;
  if (!built.marker_unit.empty()) m["markers"] = {{"unit", built.marker_unit}, {"up", built.marker_up}};
  m["wall_s"] = report.wall_s;
  if (built.calibration_offset_frames > 0)
    m["calibration_offsets"] = {{"applied", false},
                                {"largest_frames", built.calibration_offset_frames},
                                {"reason", "images are taken whole; a timeline of the take is what chooses them"}};
  m["masks_from"] = !masks ? "none" : report.inputs.masks.empty() ? "made" : report.inputs.masks;
  return m;
}

std::string BuildSummary(const DatasetBuildReport& report) {
  const dataset::BuildReport& built = report.built;
  std::string text = Format("%s: %zu cameras, %d frames, %d images in %.1f s\n", report.options.out.c_str(),
                            built.cameras.size(), built.frames, built.images, report.wall_s);
  if (!built.marker_unit.empty())
    text += "  3D joints of " + report.inputs.pose3d + ": " + built.marker_unit + ", " + built.marker_up + " up\n";
  if (!built.skeleton.empty()) {
    text += Format("  %zu joints beside Panoptic's 19: ", built.joints_beside.size()) + SomeOf(built.joints_beside) +
            "; all joints of " + built.skeleton + " are in hdPose3d_stage1_" + built.skeleton + "\n";
  }
  if (!report.inputs.masks.empty())
    text += Format("  %d masks of ", built.given_masks) + report.inputs.masks + " (option 'masks' alone makes new ones)\n";
  return text;
}

std::string MadeMaskLine(const dataset::BuiltCamera& c) {
  const std::string camera = "  " + c.name + " (" + c.alias + "): ";
  if (c.joints == 0) return camera + "no joint of Panoptic's 19 in view, so its masks are empty or uncertain\n";
  return camera + Format("person on %.1f %% of the image, colours support %d of %d joints\n", 100 * c.mean_area_fraction,
                         c.joints_supported, c.joints);
}

/// Joints that were triangulated before the rig was moved may still be in view.
Notice OtherWorldNotice(const DatasetBuildReport& report) {
  return {"DAT-WORLD",
          report.inputs.pose3d + " states another world (" + report.built.world + ") than " + report.inputs.calibration + " (" +
              report.calibrated_world + ")",
          "triangulate again with this calibration"};
}

}  // namespace

CommandResult Describe(const DatasetBuildReport& report) {
  const dataset::BuildReport& built = report.built;
  const std::string& out = report.options.out;
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  result.metrics = BuildMetrics(report);
  Append(built.warnings, &result.warnings);
  if (report.OtherWorld()) result.warnings.push_back(OtherWorldNotice(report));
  result.outputs.push_back({out, "dataset"});
  result.outputs.push_back(
      {(std::filesystem::path(out) / ("calibration_" + built.sequence + ".json")).string(), "calibration"});
  result.folder = out;
  result.inputs.insert(result.inputs.end(), {report.inputs.calibration, report.inputs.pose3d});
  if (geometry::IsSkeletonFile(report.inputs.skeleton)) result.inputs.push_back(report.inputs.skeleton);
  if (report.IsPartial()) result.exit = kExitPartial;
  if (built.images == 0) {
    result.exit = kExitBadInput;
    result.errors.push_back(
        {"DAT-INSTANTS", "no camera has an image of any time step with joints",
         "do the frame numbers in " + report.inputs.pose3d + " count the take's time steps? see session timeline"});
  }
  result.text = BuildSummary(report);
  if (!report.inputs.masks.empty()) {
    result.Add(DescribeMaskMeaning(built.masks, report.inputs.masks, result.text));
  } else if (report.options.build.masks) {
    for (const dataset::BuiltCamera& camera : built.cameras) result.text += MadeMaskLine(camera);
  }
  return result;
}

}  // namespace mvstudio::stages
