#include "core/format.h"
#include "core/units.h"
#include "geometry/rig/rig_io.h"
#include "stages/calib/calibration_use.h"
#include "stages/calib/stated_lengths.h"
#include "stages/calibrate/describe_parts.h"
#include "stages/input/calib_read.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

ordered_json PlacedCameraJson(const geometry::RigCamera& camera) {
  const CameraSigmas sigmas = SigmasOf(camera);
  ordered_json json;
  json["name"] = camera.camera.name;
  json["model"] = std::string(geometry::ToString(camera.camera.model));
  json["focal_px"] = FiniteOrNull((camera.camera.fx() + camera.camera.fy()) / 2);
  json["focal_sigma_px"] = FiniteOrNull(sigmas.focal_px);
  json["rotation_sigma_deg"] = FiniteOrNull(RadToDeg(sigmas.rotation_rad));
  json["position_sigma_mm"] = FiniteOrNull(1e3 * sigmas.position_m);
  return json;
}

void AddGross(const std::string& where, const std::vector<std::string>& gross, std::vector<Notice>* warnings) {
  for (const std::string& point : gross)
    warnings->push_back({"CAL-CLICK", where + point + " off, left out", "mark it again, or check its coordinates"});
}

CommandResult UnsolvedScene(Status status, const std::string& message) {
  CommandResult result;
  result.exit = kExitIllPosed;
  result.metrics["status"] = std::string(ToString(status));
  result.errors.push_back({"CAL-UNSOLVED", message, "status " + std::string(ToString(status))});
  return result;
}

/// A camera, or a rig, that its marks place or do not.
CommandResult DescribeResection(const calib::SceneResectionReport::CameraResult& camera) {
  const calib::PointResection& r = camera.resection;
  CommandResult result;
  ordered_json& json = result.metrics;
  json = {{"name", camera.name}, {"status", std::string(ToString(r.status))}, {"num_points", camera.num_clicks}};
  if (r.status == Status::kOk) {
    json["num_used"] = r.num_used, json["rms_px"] = FiniteOrNull(r.rms_px);
    json["leave_one_out_px"] = FiniteOrNull(r.leave_one_out_px);
    json["lens"] = r.lens_reason;
    result.text = Format("%-16s %d of %d points, rms %.2f px, left-out points %.2f px\n", camera.name.c_str(), r.num_used,
                         camera.num_clicks, r.rms_px, r.leave_one_out_px);
  } else {
    result.text = camera.name + " " + r.message + "\n";
    result.errors.push_back(
        {"CAL-UNSOLVED", camera.name + ": " + r.message, "mark more points, spread over the image and in depth"});
  }
  AddGross("camera " + camera.name + ": point ", camera.gross, &result.warnings);
  return result;
}

CommandResult DescribeFeatures(const calib::FromSceneReport& found) {
  CommandResult result;
  ordered_json& m = result.metrics;
  m["gauge"] = GaugeText(found.rig.gauge);
  m["rms_px"] = FiniteOrNull(found.bundle.rms_px);
  m["feature_sigma_px"] = FiniteOrNull(found.feature_sigma_px);
  m["own_lenses"] = found.own_lenses;
  m["variance_factor"] = FiniteOrNull(found.clusters.factor);
  m["num_points"] = found.num_points;
  m["num_features"] = found.bundle.num_observations;
  m["num_rejected"] = found.bundle.num_rejected;
  m["missing"] = found.missing;
  m["cameras"] = ordered_json::array();
  for (size_t c = 0; c < found.rig.cameras.size(); ++c) {
    m["cameras"].push_back(PlacedCameraJson(found.rig.cameras[c]));
    m["cameras"].back()["num_features"] = found.num_seen[c];
    const CameraSigmas sigmas = SigmasOf(found.rig.cameras[c]);
    result.text += Format("%-16s focal %9.2f px, %5d features, position +- %.2f mm, rotation +- %.4f deg\n",
                          found.rig.cameras[c].camera.name.c_str(), found.rig.cameras[c].camera.fx(), found.num_seen[c],
                          1e3 * sigmas.position_m, RadToDeg(sigmas.rotation_rad));
  }
  result.text += Format("%d points, %d features kept, %d rejected, feature sigma %.3f px, world: %s\n", found.num_points,
                        found.bundle.num_observations, found.bundle.num_rejected, found.feature_sigma_px,
                        GaugeText(found.rig.gauge).c_str());
  return result;
}

}  // namespace

CommandResult DescribeFound(const CalibrateReport& report, const MarkedCalibration& found) {
  const calib::MarkedRig& placed = found.placed;
  if (placed.status != Status::kOk) return UnsolvedScene(placed.status, placed.message);
  CommandResult result;
  AddGross("click ", placed.gross, &result.warnings);
  result.Add(DescribeLengths(*found.scale));
  if (found.scale->status != Status::kOk) return result;
  result.metrics["gauge"] = GaugeText(placed.rig.gauge);
  result.metrics["rms_px"] = FiniteOrNull(placed.rms_px);
  ordered_json& cameras = result.metrics["cameras"] = ordered_json::array();
  std::string lines;
  for (size_t c = 0; c < placed.rig.cameras.size(); ++c) {
    ordered_json json = PlacedCameraJson(placed.rig.cameras[c]);
    json["num_points"] = placed.num_clicks[c], json["num_used"] = placed.num_used[c];
    lines +=
        Format("%-16s %d of %d marks\n", placed.rig.cameras[c].camera.name.c_str(), placed.num_used[c], placed.num_clicks[c]);
    cameras.push_back(json);
  }
  result.text =
      lines +
      Format("%zu marks, rms %.2f px, world: %s\n", placed.points.size(), placed.rms_px, GaugeText(placed.rig.gauge).c_str()) +
      result.text;
  result.warnings.push_back({"CAL-WORLD", "the world is that of " + placed.rig.cameras[0].camera.name,
                             "mvstudio calib align option 'floor-joints', or option 'floor-board', sets the floor"});
  result.Add(DescribeWritten(report, placed.rig));
  return result;
}

CommandResult DescribeFound(const CalibrateReport& report, const calib::SceneResectionReport& found) {
  CommandResult result;
  result.metrics["gauge"] = GaugeText(found.rig.gauge);
  ordered_json cameras = ordered_json::array();
  for (const auto& camera : found.cameras) {
    CommandResult said = DescribeResection(camera);
    cameras.push_back(std::move(said.metrics));
    said.metrics = ordered_json::object();
    result.Add(std::move(said));
  }
  result.metrics["cameras"] = std::move(cameras);
  result.metrics["poses"] = ordered_json::array();
  for (const geometry::RigCamera& camera : found.rig.cameras) result.metrics["poses"].push_back(PlacedCameraJson(camera));
  if (found.rig.cameras.empty()) {
    result.exit = kExitIllPosed;
    return result;
  }
  result.Add(DescribeWritten(report, found.rig, found.given_unknown));
  if (!result.errors.empty()) result.exit = kExitPartial;
  return result;
}

CommandResult DescribeFound(const CalibrateReport& report, const calib::FromSceneReport& found) {
  if (found.status != Status::kOk) return UnsolvedScene(found.status, found.message);
  constexpr double kMisfit = 10;
  CommandResult result = DescribeFeatures(found);
  if (found.clusters.factor > kMisfit) {
    result.warnings.push_back(
        {"CAL-MISFIT",
         Format("neighbouring features err together: variances are %.0f times those of independent errors",
                found.clusters.factor),
         "the lens model does not fit: give the lenses with option 'start'"});
  }
  AddGross("", found.gross, &result.warnings);
  result.Add(DescribeWritten(report, found.rig));
  for (const std::string& camera : found.missing) {
    result.exit = kExitPartial;
    result.errors.push_back({"CAL-UNPLACED", "camera " + camera + " shares too few features with the others",
                             "more texture where its view meets another's, or a camera in between"});
  }
  return result;
}

}  // namespace mvstudio::stages
