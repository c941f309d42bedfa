#include "stages/calib_files/describe.h"

#include "core/format.h"
#include "geometry/rig/plausible.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

/// Which camera became which, where a format has names of its own.
CommandResult DescribeRenamed(const CalibConvertReport& report) {
  CommandResult result;
  std::string mapping;
  for (const auto& [from, to] : report.renamed) {
    mapping += (mapping.empty() ? "" : ", ") + from + "=" + to;
    result.metrics["renamed"][from] = to;
  }
  if (report.renumbered)
    result.warnings.push_back({"CAL-RENAMED", "Panoptic names its cameras 00_NN; renamed in order: " + mapping,
                               "choose the names yourself with option 'rename' OLD=NEW"});
  return result;
}

ordered_json ResizedJson(const geometry::Camera& before, const geometry::Camera& after) {
  return {{"name", after.name},
          {"old_size_px", {before.width_px, before.height_px}},
          {"size_px", {after.width_px, after.height_px}},
          {"fx", after.fx()},
          {"fy", after.fy()},
          {"cx", after.cx()},
          {"cy", after.cy()}};
}

std::string LensLine(const geometry::RigCamera& lens) {
  const geometry::Camera& c = lens.camera;
  const double sigma = SigmasOf(lens).focal_px;
  return Format("%-32s %-14s %5d x %-5d", c.name.c_str(), std::string(geometry::ToString(c.model)).c_str(), c.width_px,
                c.height_px) +
         Format(" %9.2f px  +- %s\n", (c.fx() + c.fy()) / 2, std::isfinite(sigma) ? Format("%.2f", sigma).c_str() : "?");
}

}  // namespace

CommandResult Describe(const CalibConvertReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  result.Add(DescribeRenamed(report));
  for (const std::string& file : report.files) result.outputs.push_back({file, "calibration"});
  result.Add(DescribeCameras(report.rig));
  result.metrics["format"] = report.format;
  result.folder = report.folder;
  result.text =
      std::to_string(report.rig.cameras.size()) + " cameras -> " + report.options.out + " (" + report.options.to + ")";
  return result;
}

CommandResult Describe(const CalibResizeReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  ordered_json& rows = result.metrics["cameras"] = ordered_json::array();
  for (const auto& [before, after] : report.cameras) {
    rows.push_back(ResizedJson(before, after));
    result.text += Format("%s: %d x %d -> ", after.name.c_str(), before.width_px, before.height_px) +
                   Format("%d x %d, fx %.2f, fy %.2f px\n", after.width_px, after.height_px, after.fx(), after.fy());
  }
  result.outputs.push_back({report.out, "calibration"});
  return result;
}

CommandResult Describe(const LensAddReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  result.outputs.push_back({report.library, "lenses"});
  result.metrics["num_lenses"] = report.lenses.cameras.size();
  result.text = LensLine(report.lens);
  return result;
}

/// Each lens by itself: a library has no poses to be doubted.
CommandResult Describe(const LensListReport& report) {
  CommandResult result = DescribeCameras(report.lenses);
  result.inputs.push_back(report.library);
  for (const geometry::RigCamera& lens : report.lenses.cameras) {
    result.text += LensLine(lens);
    if (!report.check) continue;
    geometry::Rig alone;
    alone.cameras = {lens};
    AddImplausible(alone, &result);
    if (lens.params_covariance) continue;
    result.warnings.push_back({"CAL-COVARIANCE-MISSING", "lens " + lens.camera.name + " states no covariance",
                               "calibrate it again, or count its uncertainty as unknown"});
  }
  if (!result.warnings.empty()) result.exit = kExitQualityGate;
  return result;
}

}  // namespace mvstudio::stages
