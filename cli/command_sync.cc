#include <cmath>
#include <cstdio>
#include <filesystem>

#include "cli/commands.h"
#include "cli/pose_input.h"
#include "cli/triangulate_take.h"
#include "core/error.h"
#include "core/files.h"
#include "dataset/sync_file.h"
#include "triangulate/sync.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;
using triangulate::CameraSync;
using triangulate::SyncResult;
using triangulate::SyncStatus;

struct Arguments {
  PoseArguments pose;
  std::string out;
  double fps = 0;
  bool range_given = false;
  triangulate::SyncOptions options;
};

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

ordered_json CameraJson(const CameraSync& camera, double fps) {
  const bool ok = camera.status == SyncStatus::kOk;
  ordered_json json{{"name", camera.name}, {"status", std::string(ToString(camera.status))}};
  json["offset_frames"] = ok ? FiniteOrNull(camera.offset_frames) : ordered_json(nullptr);
  json["sigma_frames"] = ok ? FiniteOrNull(camera.sigma_frames) : ordered_json(nullptr);
  if (fps > 0) {
    json["offset_ms"] = ok ? FiniteOrNull(1000 * camera.offset_frames / fps) : ordered_json(nullptr);
    json["sigma_ms"] = ok ? FiniteOrNull(1000 * camera.sigma_frames / fps) : ordered_json(nullptr);
  }
  json["contrast"] = FiniteOrNull(camera.contrast);
  json["agreement"] = FiniteOrNull(camera.agreement);
  json["runner_up_frames"] = FiniteOrNull(camera.runner_up_frames);
  json["peak_ratio"] = FiniteOrNull(camera.peak_ratio);
  json["num_pairs"] = camera.num_pairs;
  json["num_pairs_disagree"] = camera.num_pairs_disagree;
  return json;
}

void AddMetrics(const SyncResult& sync, double fps, CommandResult* result) {
  ordered_json& metrics = result->metrics;
  metrics["status"] = std::string(ToString(sync.status));
  metrics["reference"] = sync.cameras[static_cast<size_t>(sync.reference_idx)].name;
  metrics["median_residual_px"] = {{"before", FiniteOrNull(sync.residual_before_px)},
                                   {"after", FiniteOrNull(sync.residual_after_px)}};
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
  const PoseInput input = ReadPoseInput(arguments.pose, &result);
  const geometry::Rig filmed = Filmed(input.rig, input.tracks);
  triangulate::SyncOptions options = arguments.options;
  if (arguments.fps > 0 && !arguments.range_given) {
    options.max_offset_frames = static_cast<int>(std::lround(kRangeSeconds * arguments.fps));
  }
  const SyncResult sync = SynchronizeCameras(
      triangulate::Prepare(filmed),
      filmed.cameras.size() == input.rig.cameras.size() ? input.frames : ToFrames(input.tracks, filmed, arguments.pose.calib),
      options, context.run);
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
  AddPoseArguments(sub, arguments->pose);
  sub->add_option("--out", arguments->out, "folder for sync.json")->required();
  sub->add_option("--fps", arguments->fps, "frames a second of all cameras; then offsets in ms too, looked for within 3 s");
  AddOptions(sub, arguments->options);
  registry.Add(sub, "sync", [arguments, sub](CommandContext& context) {
    arguments->range_given = sub->count("--max-offset-frames") > 0;
    return Run(*arguments, context);
  });
}

}  // namespace mvstudio::cli
