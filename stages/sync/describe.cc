#include "stages/sync/describe.h"

#include <cmath>

#include "core/format.h"
#include "stages/older_kept.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;
using triangulate::CameraSync;
using triangulate::SyncResult;
using triangulate::SyncStatus;

ordered_json CameraSyncJson(const CameraSync& camera, double fps_hz) {
  const bool ok = camera.status == SyncStatus::kOk;
  const auto if_ok = [ok](double value) { return ok ? FiniteOrNull(value) : ordered_json(nullptr); };
  ordered_json json{{"name", camera.name}, {"status", std::string(ToString(camera.status))}};
  json["offset_frames"] = if_ok(camera.offset_frames);
  json["sigma_frames"] = if_ok(camera.sigma_frames);
  if (fps_hz > 0) {
    json["offset_ms"] = if_ok(1000 * camera.offset_frames / camera.nominal_rate / fps_hz);
    json["sigma_ms"] = if_ok(1000 * camera.sigma_frames / camera.nominal_rate / fps_hz);
  }
  json["nominal_rate"] = camera.nominal_rate;
  json["rate_ppm"] = FiniteOrNull(camera.rate_ppm);
  json["sigma_rate_ppm"] = FiniteOrNull(camera.sigma_rate_ppm);
  json["contrast"] = FiniteOrNull(camera.contrast);
  json["agreement"] = FiniteOrNull(camera.agreement);
  json["runner_up_frames"] = FiniteOrNull(camera.runner_up_frames);
  json["peak_ratio"] = FiniteOrNull(camera.peak_ratio);
  json["num_pairs"] = camera.num_pairs;
  json["num_pairs_disagree"] = camera.num_pairs_disagree;
  return json;
}

ordered_json PoseSyncMetrics(const SyncReport& report) {
  const SyncResult& sync = *report.by_poses;
  ordered_json metrics = {
      {"first_offsets", report.began_by_time_codes ? "timecodes" : "none"},
      {"status", std::string(ToString(sync.status))},
      {"reference", report.file.reference},
      {"median_residual_px",
       {{"before", FiniteOrNull(sync.residual_before_px)}, {"after", FiniteOrNull(sync.residual_after_px)}}},
      {"num_points", sync.num_points},
      {"cameras", ordered_json::array()}};
  for (const CameraSync& camera : sync.cameras) metrics["cameras"].push_back(CameraSyncJson(camera, report.fps_hz));
  return metrics;
}

const char* SyncHint(SyncStatus status) {
  switch (status) {
    case SyncStatus::kTooFewDetections:
      return "check the folder; or look further with option 'max-offset-frames', or ask for less with option 'min-frames'";
    case SyncStatus::kNoMotion:
      return "use a part of the take where somebody moves all the time, in no regular rhythm";
    case SyncStatus::kAmbiguous:
      return "narrow option 'max-offset-frames' to less than one period, or use a part with irregular motion";
    default:
      return "check that the folder belongs to this camera, and the calibration";
  }
}

/// What a clock does beside being offset; empty: nothing.
std::string RateText(const CameraSync& camera) {
  std::string text;
  if (camera.nominal_rate != 1) text += Format("  %.4g frames for one of the reference", camera.nominal_rate);
  if (camera.rate_ppm != 0) text += Format("  %+.0f +- %.0f ppm", camera.rate_ppm, camera.sigma_rate_ppm);
  return text;
}

std::string OffsetLine(const CameraSync& camera, double fps_hz) {
  if (camera.status != SyncStatus::kOk) return camera.name + "  " + std::string(ToString(camera.status)) + "\n";
  std::string text = Format("%-12s %+9.3f +- %.3f frames", camera.name.c_str(), camera.offset_frames, camera.sigma_frames);
  if (fps_hz > 0) {
    const double ms = 1000 / fps_hz / camera.nominal_rate;
    text += Format("  %+9.2f +- %.2f ms", ms * camera.offset_frames, ms * camera.sigma_frames);
  }
  return text + RateText(camera) + "\n";
}

CommandResult DescribePoseSync(const SyncReport& report) {
  const SyncResult& sync = *report.by_poses;
  CommandResult result;
  result.metrics = PoseSyncMetrics(report);
  result.text = "reference " + report.file.reference;
  if (std::isfinite(sync.residual_after_px))
    result.text += Format("; median residual %.2f -> %.2f px", sync.residual_before_px, sync.residual_after_px);
  result.text += "\n";
  for (const CameraSync& camera : sync.cameras) {
    result.text += OffsetLine(camera, report.fps_hz);
    if (camera.status != SyncStatus::kOk)
      result.errors.push_back({"SYN-UNDETERMINED", camera.message, SyncHint(camera.status)});
  }
  if (result.errors.empty())
    result.text +=
        "a camera at +n shows in its frame f + n what the reference shows in frame f; option 'sync' of triangulate "
        "takes the file\n";
  return result;
}

std::string OffsetLine(const dataset::SyncedCamera& camera) {
  if (!camera.offset_frames) return camera.name + "  " + camera.status + "\n";
  std::string text = Format("%-12s %+9.3f +- %.3f frames %+8.2f ppm", camera.name.c_str(), *camera.offset_frames,
                            camera.sigma_frames, camera.rate_ppm);
  if (camera.nominal_rate != 1) text += Format("  %.6g frames for one of the reference", camera.nominal_rate);
  return text + "\n";
}

ordered_json SyncedCameraJson(const dataset::SyncedCamera& camera) {
  ordered_json json{{"name", camera.name}, {"status", camera.status}, {"offset_frames", nullptr}, {"sigma_frames", nullptr}};
  if (!camera.offset_frames) return json;
  json["offset_frames"] = FiniteOrNull(*camera.offset_frames);
  json["sigma_frames"] = FiniteOrNull(camera.sigma_frames);
  json["nominal_rate"] = camera.nominal_rate, json["rate_ppm"] = FiniteOrNull(camera.rate_ppm);
  return json;
}

/// Offsets that did not come from poses.
CommandResult DescribeFootageSync(const SyncReport& report) {
  const char* hint =
      report.by_motion ? "film people who move, in no regular rhythm; or use 2D poses" : "see mvstudio session timeline";
  CommandResult result;
  result.metrics["reference"] = report.file.reference;
  ordered_json& cameras = result.metrics["cameras"] = ordered_json::array();
  result.text = "reference " + report.file.reference + "\n";
  for (const dataset::SyncedCamera& camera : report.file.cameras) {
    cameras.push_back(SyncedCameraJson(camera));
    result.text += OffsetLine(camera);
    if (!camera.offset_frames)
      result.errors.push_back({"SYN-UNDETERMINED", "camera " + camera.name + ": " + camera.status, hint});
  }
  for (size_t i = 0; report.by_motion && i < report.by_motion->cameras.size(); ++i) {
    cameras[i]["correlation"] = FiniteOrNull(report.by_motion->cameras[i].correlation);
    cameras[i]["runner_up"] = FiniteOrNull(report.by_motion->cameras[i].runner_up);
  }
  result.metrics["status"] = result.errors.empty() ? "Ok" : report.Failed() ? "Undetermined" : "Partial";
  return result;
}

}  // namespace

CommandResult Describe(const SyncReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  if (report.project) result.metrics["project"] = ProjectJson(*report.project);
  result.Add(report.by_poses ? DescribePoseSync(report) : DescribeFootageSync(report));
  if (!result.errors.empty()) result.exit = report.Failed() ? kExitIllPosed : kExitPartial;
  if (report.kept_older) {
    result.warnings.push_back(OlderKept(report.path));
    return result;
  }
  result.folder = report.folder;
  result.outputs.push_back({report.path, "sync"});
  return result;
}

}  // namespace mvstudio::stages
