#include <cmath>
#include <cstdio>
#include <filesystem>
#include <set>

#include "cli/commands.h"
#include "cli/triangulate_take.h"
#include "core/error.h"
#include "core/files.h"
#include "dataset/panoptic.h"
#include "dataset/sync_file.h"
#include "triangulate/sync.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;
using triangulate::CameraSync;
using triangulate::SyncResult;
using triangulate::SyncStatus;

struct Arguments {
  std::string calib, skeleton = "body25", out;
  std::vector<std::string> pose2d;
  double fps = 0;
  bool range_given = false;
  triangulate::SyncOptions options;
};

std::vector<dataset::Pose2dTrack> ReadTracks(const Arguments& arguments, CommandResult* result) {
  const body::Skeleton& skeleton = body::SkeletonByName(arguments.skeleton);
  std::vector<dataset::Pose2dTrack> tracks;
  std::set<std::string> seen;
  for (const std::string& text : arguments.pose2d) {
    const auto [camera, folder] = SplitNamePath("--pose2d", text);
    if (!seen.insert(camera).second) throw UsageError("--pose2d names camera " + camera + " twice");
    tracks.push_back(dataset::ReadOpenPoseFolder(folder, camera, skeleton));
    result->inputs.push_back(folder);
  }
  if (tracks.size() < 2) throw UsageError("--pose2d: at least two cameras are needed, given as NAME=FOLDER each");
  return tracks;
}

/// The cameras that have poses; others have no clock to find.
geometry::Rig Filmed(const geometry::Rig& rig, const std::vector<dataset::Pose2dTrack>& tracks) {
  geometry::Rig filmed;
  filmed.gauge = rig.gauge;
  for (const geometry::RigCamera& camera : rig.cameras) {
    for (const auto& track : tracks) {
      if (track.camera == camera.camera.name) filmed.cameras.push_back(camera);
    }
  }
  return filmed;
}

ordered_json Number(double value) { return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr); }

ordered_json CameraJson(const CameraSync& camera, double fps) {
  const bool ok = camera.status == SyncStatus::kOk;
  ordered_json json{{"name", camera.name}, {"status", std::string(ToString(camera.status))}};
  json["offset_frames"] = ok ? Number(camera.offset_frames) : ordered_json(nullptr);
  json["sigma_frames"] = ok ? Number(camera.sigma_frames) : ordered_json(nullptr);
  if (fps > 0) {
    json["offset_ms"] = ok ? Number(1000 * camera.offset_frames / fps) : ordered_json(nullptr);
    json["sigma_ms"] = ok ? Number(1000 * camera.sigma_frames / fps) : ordered_json(nullptr);
  }
  json["contrast"] = Number(camera.contrast);
  json["agreement"] = Number(camera.agreement);
  json["runner_up_frames"] = Number(camera.runner_up_frames);
  json["peak_ratio"] = Number(camera.peak_ratio);
  json["num_pairs"] = camera.num_pairs;
  json["num_pairs_disagree"] = camera.num_pairs_disagree;
  return json;
}

void AddMetrics(const SyncResult& sync, double fps, CommandResult* result) {
  ordered_json& metrics = result->metrics;
  metrics["status"] = std::string(ToString(sync.status));
  metrics["reference"] = sync.cameras[static_cast<size_t>(sync.reference_idx)].name;
  metrics["median_residual_px"] = {{"before", Number(sync.residual_before_px)}, {"after", Number(sync.residual_after_px)}};
  metrics["num_points"] = sync.num_points;
  metrics["cameras"] = ordered_json::array();
  for (const CameraSync& camera : sync.cameras) metrics["cameras"].push_back(CameraJson(camera, fps));
}

const char* Hint(SyncStatus status) {
  switch (status) {
    case SyncStatus::kTooFewDetections:
      return "check the folder; or look further with --max-offset-frames, or ask for less with --min-frames";
    case SyncStatus::kNoMotion:
      return "use a part of the take where somebody moves all the time, in no regular rhythm";
    case SyncStatus::kAmbiguous:
      return "narrow --max-offset-frames to less than one period, or use a part with irregular motion";
    default:
      return "check that the folder belongs to this camera, and the calibration";
  }
}

void AddErrors(const SyncResult& sync, CommandResult* result) {
  int num_ok = 0;
  for (const CameraSync& camera : sync.cameras) {
    num_ok += camera.status == SyncStatus::kOk;
    if (camera.status == SyncStatus::kOk) continue;
    result->errors.push_back({"SYN-UNDETERMINED", camera.message, Hint(camera.status)});
  }
  if (num_ok < static_cast<int>(sync.cameras.size())) result->exit = num_ok > 0 ? kExitPartial : kExitIllPosed;
}

dataset::SyncFile ToFile(const SyncResult& sync, double fps) {
  dataset::SyncFile file;
  file.reference = sync.cameras[static_cast<size_t>(sync.reference_idx)].name;
  if (fps > 0) file.fps = fps;
  for (const CameraSync& camera : sync.cameras) {
    dataset::SyncedCamera& entry = file.cameras.emplace_back();
    entry.name = camera.name;
    entry.status = std::string(ToString(camera.status));
    if (camera.status != SyncStatus::kOk) continue;
    entry.offset_frames = camera.offset_frames;
    entry.sigma_frames = camera.sigma_frames;
  }
  return file;
}

std::string Summary(const SyncResult& sync, double fps) {
  char line[240];
  std::snprintf(line, sizeof line, "reference %s; median residual %.2f -> %.2f px\n",
                sync.cameras[static_cast<size_t>(sync.reference_idx)].name.c_str(), sync.residual_before_px,
                sync.residual_after_px);
  std::string text = line;
  for (const CameraSync& camera : sync.cameras) {
    if (camera.status != SyncStatus::kOk) {
      text += camera.name + "  " + std::string(ToString(camera.status)) + "\n";
      continue;
    }
    std::snprintf(line, sizeof line, "%-12s %+9.3f +- %.3f frames", camera.name.c_str(), camera.offset_frames,
                  camera.sigma_frames);
    text += line;
    if (fps > 0) {
      std::snprintf(line, sizeof line, "  %+9.2f +- %.2f ms", 1000 * camera.offset_frames / fps,
                    1000 * camera.sigma_frames / fps);
      text += line;
    }
    text += "\n";
  }
  return text;
}

CommandResult Run(const Arguments& arguments, CommandContext& context) {
  constexpr double kRangeSeconds = 3;
  if (!(arguments.fps >= 0) || !std::isfinite(arguments.fps)) throw UsageError("--fps must be positive");
  CommandResult result;
  result.folder = arguments.out;
  result.inputs = {arguments.calib};
  const geometry::Rig rig = dataset::ReadAnyCalibration(arguments.calib);
  const auto tracks = ReadTracks(arguments, &result);
  const auto frames = ToFrames(tracks, rig, arguments.calib);  // names any camera that is not calibrated
  const geometry::Rig filmed = Filmed(rig, tracks);
  triangulate::SyncOptions options = arguments.options;
  if (arguments.fps > 0 && !arguments.range_given) {
    options.max_offset_frames = static_cast<int>(std::lround(kRangeSeconds * arguments.fps));
  }
  const SyncResult sync = SynchronizeCameras(
      triangulate::Prepare(filmed),
      filmed.cameras.size() == rig.cameras.size() ? frames : ToFrames(tracks, filmed, arguments.calib), options, context.run);
  AddMetrics(sync, arguments.fps, &result);
  AddErrors(sync, &result);
  const std::string path = (std::filesystem::path(arguments.out) / "sync.json").string();
  dataset::WriteSync(ToFile(sync, arguments.fps), path);
  result.outputs.push_back({path, "sync"});
  result.text = Summary(sync, arguments.fps);
  return result;
}

}  // namespace

void RegisterSync(CLI::App& app, Registry& registry) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("sync", "Time offsets of the cameras, from people who move in the take");
  sub->add_option("--calib", arguments->calib, "calibration file, ours or Panoptic's calibration_*.json")->required();
  sub->add_option("--pose2d", arguments->pose2d, "NAME=FOLDER of OpenPose JSON files; once a camera")->required();
  sub->add_option("--skeleton", arguments->skeleton, "body25 | body25b | coco17 | coco18 | coco19")->capture_default_str();
  sub->add_option("--out", arguments->out, "folder for sync.json")->required();
  sub->add_option("--fps", arguments->fps, "frames a second of all cameras; then offsets in ms too, looked for within 3 s");
  AddOptions(sub, arguments->options);
  registry.Add(sub, "sync", [arguments, sub](CommandContext& context) {
    arguments->range_given = sub->count("--max-offset-frames") > 0;
    return Run(*arguments, context);
  });
}

}  // namespace mvstudio::cli
