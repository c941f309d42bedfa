#include "triangulate/sync/sync.h"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>

#include "cli/program/arguments.h"
#include "cli/program/commands.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "dataset/footage/frame_rate.h"
#include "dataset/footage/frames.h"
#include "dataset/session/timeline_source.h"
#include "dataset/time/motion_sync.h"
#include "dataset/time/sync_file.h"
#include "stages/input/pose_input.h"
#include "stages/input/project_input.h"
#include "stages/input/session_input.h"
#include "stages/input/take_frames.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;
using triangulate::CameraSync;
using triangulate::SyncResult;
using triangulate::SyncStatus;

struct Arguments {
  stages::PoseArguments pose;
  stages::SessionArguments session;
  std::string project, out, from = "poses";
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
    json["offset_ms"] = ok ? FiniteOrNull(1000 * camera.offset_frames / camera.nominal_rate / fps) : ordered_json(nullptr);
    json["sigma_ms"] = ok ? FiniteOrNull(1000 * camera.sigma_frames / camera.nominal_rate / fps) : ordered_json(nullptr);
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
    entry.nominal_rate = camera.nominal_rate;
    entry.rate_ppm = camera.rate_ppm;
  }
  return file;
}

/// What a clock does beside being offset; empty: nothing.
std::string RateText(const CameraSync& camera) {
  std::string text;
  if (camera.nominal_rate != 1) text += Format("  %.4g frames for one of the reference", camera.nominal_rate);
  if (camera.rate_ppm != 0) text += Format("  %+.0f +- %.0f ppm", camera.rate_ppm, camera.sigma_rate_ppm);
  return text;
}

std::string Summary(const SyncResult& sync, double fps) {
  std::string text = "reference " + sync.cameras[static_cast<size_t>(sync.reference_idx)].name;
  if (std::isfinite(sync.residual_after_px))
    text += Format("; median residual %.2f -> %.2f px", sync.residual_before_px, sync.residual_after_px);
  text += "\n";
  for (const CameraSync& camera : sync.cameras) {
    if (camera.status != SyncStatus::kOk) {
      text += camera.name + "  " + std::string(ToString(camera.status)) + "\n";
      continue;
    }
    text += Format("%-12s %+9.3f +- %.3f frames", camera.name.c_str(), camera.offset_frames, camera.sigma_frames);
    if (fps > 0) {
      const double ms = 1000 / fps / camera.nominal_rate;
      text += Format("  %+9.2f +- %.2f ms", ms * camera.offset_frames, ms * camera.sigma_frames);
    }
    text += RateText(camera) + "\n";
  }
  return text;
}

/// What --session and --take say, in place of the flags that were not given.
std::optional<stages::FoundTake> FillFromSession(Arguments* arguments, CommandResult* result) {
  std::optional<stages::FoundTake> found = stages::FindTake(arguments->session, result);
  if (!found) return found;
  if (arguments->out.empty()) arguments->out = dataset::TakeFolder(found->session, "sync", found->take.name);
  if (arguments->fps <= 0) arguments->fps = found->take.fps_hz.value_or(found->session.fps_hz.value_or(0));
  if (arguments->from != "poses") return found;
  const bool own = !arguments->pose.pose2d.empty();
  stages::FillPoses(*found, arguments->session, &arguments->pose);
  if (!own) stages::LeaveOutUncalibrated(&arguments->pose, result);
  return found;
}

/// Detectors number the frames that were recorded; dropped ones must count too.
void CountDropped(const stages::FoundTake& found, const Arguments& arguments, stages::PoseInput* input, CommandResult* result) {
  if (!stages::RenumberByClock(found, arguments.session, input)) return;
  input->frames = stages::ToFrames(input->tracks, input->rig, arguments.pose.calib);
  result->warnings.push_back({"SYN-DROPPED", "cameras dropped or doubled frames: offsets count the time steps of their clocks",
                              "see mvstudio session timeline"});
}

/// Whole frames by which each camera's numbers lead the reference's, by the videos' time codes; empty unless all have one.
std::map<std::string, int> OffsetsByTimeCodes(const stages::FoundTake& found, const Arguments& arguments) {
  dataset::TakeTimelineOptions options;
  options.allow_outside = arguments.session.allow_outside;
  options.time_codes = true;
  for (const dataset::SessionFootage& f : found.take.footage) {
    const std::string path = dataset::ResolveInSession(found.session, f.path, options.allow_outside);
    if (!dataset::DescribeFootage(path).time_code_s) return {};
  }
  std::map<std::string, int> offsets;
  try {
    const dataset::TakeTimeline made = dataset::BuildTakeTimeline(found.session, found.take, options);
    for (const dataset::SyncedCamera& camera : dataset::SyncFromTimeline(made.timeline).cameras) {
      if (!camera.offset_frames) return {};
      offsets[camera.name] = static_cast<int>(std::lround(*camera.offset_frames));
    }
  } catch (const UsageError&) {  // no time codes
  }
  return offsets;
}

/// Moves the frames so that those of one time code have one number, the earliest camera's numbers staying.
void AlignByTimeCodes(const std::map<std::string, int>& offsets, stages::PoseInput* input) {
  int largest = 0;
  for (const auto& [camera, offset] : offsets) largest = std::max(largest, offset);
  for (dataset::Pose2dTrack& track : input->tracks) {
    const auto offset = offsets.find(track.camera);
    std::map<int, std::vector<dataset::Person2d>> frames;
    for (auto& [frame, people] : track.frames)
      frames[frame + largest - (offset == offsets.end() ? 0 : offset->second)] = std::move(people);
    track.frames = std::move(frames);
  }
}

/// The offsets of the cameras' own numbers from those of the aligned ones.
void UndoAlignment(const std::map<std::string, int>& offsets, SyncResult* sync) {
  const auto of = [&](const CameraSync& camera) {
    const auto found = offsets.find(camera.name);
    return found == offsets.end() ? 0 : found->second;
  };
  const int reference = of(sync->cameras[static_cast<size_t>(sync->reference_idx)]);
  for (CameraSync& camera : sync->cameras) {
    camera.offset_frames += of(camera) - reference;
    camera.runner_up_frames += of(camera) - reference;
  }
}

void Write(const dataset::SyncFile& file, const Arguments& arguments, CommandResult* result) {
  const std::string path = (std::filesystem::path(arguments.out) / "sync.json").string();
  if (KeepsOlder(path, result)) return;
  dataset::WriteSync(file, path);
  result->outputs.push_back({path, "sync"});
}

CommandResult RunPoses(const Arguments& arguments, const std::optional<stages::FoundTake>& found, CommandContext& context,
                       CommandResult result) {
  constexpr double kRangeSeconds = 3;
  if (arguments.pose.calib.empty()) throw UsageError("--calib is required, or a --session that has a calibration");
  stages::PoseInput input = stages::ReadPoseInput(arguments.pose, &result);
  if (found) CountDropped(*found, arguments, &input, &result);
  const std::map<std::string, int> first = found ? OffsetsByTimeCodes(*found, arguments) : std::map<std::string, int>{};
  if (!first.empty()) {
    AlignByTimeCodes(first, &input);
    input.frames = stages::ToFrames(input.tracks, input.rig, arguments.pose.calib);
  }
  result.metrics["first_offsets"] = first.empty() ? "none" : "timecodes";
  const geometry::Rig filmed = Filmed(input.rig, input.tracks);
  triangulate::SyncOptions options = arguments.options;
  if (arguments.fps > 0 && !arguments.range_given) {
    options.max_offset_frames = static_cast<int>(std::lround(kRangeSeconds * arguments.fps));
  }
  SyncResult sync = SynchronizeCameras(triangulate::Prepare(filmed),
                                       filmed.cameras.size() == input.rig.cameras.size()
                                           ? input.frames
                                           : stages::ToFrames(input.tracks, filmed, arguments.pose.calib),
                                       options, context.run);
  UndoAlignment(first, &sync);
  AddMetrics(sync, arguments.fps, &result);
  AddErrors(sync, &result);
  Write(ToFile(sync, arguments.fps), arguments, &result);
  result.text = Summary(sync, arguments.fps);
  if (result.errors.empty())
    result.text +=
        "a camera at +n shows in its frame f + n what the reference shows in frame f; option 'sync' of triangulate "
        "takes the file\n";
  return result;
}

/// Metrics, text and exit code of offsets that did not come from poses.
void Describe(const dataset::SyncFile& file, const char* hint, CommandResult* result) {
  int num_ok = 0;
  result->metrics["reference"] = file.reference;
  result->metrics["cameras"] = ordered_json::array();
  result->text = "reference " + file.reference + "\n";
  for (const dataset::SyncedCamera& c : file.cameras) {
    ordered_json json{{"name", c.name}, {"status", c.status}, {"offset_frames", nullptr}, {"sigma_frames", nullptr}};
    if (c.offset_frames) {
      ++num_ok;
      json["offset_frames"] = FiniteOrNull(*c.offset_frames);
      json["sigma_frames"] = FiniteOrNull(c.sigma_frames);
      json["nominal_rate"] = c.nominal_rate, json["rate_ppm"] = FiniteOrNull(c.rate_ppm);
      result->text +=
          Format("%-12s %+9.3f +- %.3f frames %+8.2f ppm", c.name.c_str(), *c.offset_frames, c.sigma_frames, c.rate_ppm);
      if (c.nominal_rate != 1) result->text += Format("  %.6g frames for one of the reference", c.nominal_rate);
      result->text += "\n";
    } else {
      result->errors.push_back({"SYN-UNDETERMINED", "camera " + c.name + ": " + c.status, hint});
      result->text += c.name + "  " + c.status + "\n";
    }
    result->metrics["cameras"].push_back(json);
  }
  const int total = static_cast<int>(file.cameras.size());
  result->metrics["status"] = num_ok == total ? "Ok" : num_ok > 1 ? "Partial" : "Undetermined";
  if (num_ok < total) result->exit = num_ok > 1 ? kExitPartial : kExitIllPosed;
}

/// A time code counts whole frames: the difference of two has the spread of that of two uniform frames.
void WidenToFrames(dataset::SyncFile* file) {
  const double sigma_frames = std::sqrt(2.0 / 12);
  for (dataset::SyncedCamera& camera : file->cameras) {
    if (camera.name != file->reference) camera.sigma_frames = std::max(camera.sigma_frames, sigma_frames);
  }
}

CommandResult RunTimestamps(const Arguments& arguments, const stages::FoundTake& found, CommandContext& context,
                            CommandResult result) {
  const bool by_codes = arguments.from == "timecodes";
  if (!by_codes && found.take.timestamps.empty()) {
    throw UsageError("take " + found.take.name + " names no table of time stamps: timestamps = \"FILE.csv\" in mvstudio.toml");
  }
  dataset::TakeTimelineOptions options;
  options.allow_outside = arguments.session.allow_outside;
  options.timeline.reference = arguments.options.reference;
  options.time_codes = by_codes;
  const dataset::TakeTimeline made = dataset::BuildTakeTimeline(found.session, found.take, options, context.run);
  for (const std::string& note : made.notes) result.warnings.push_back({"SES-TIMELINE", note, ""});
  dataset::SyncFile file = dataset::SyncFromTimeline(made.timeline);
  if (by_codes) WidenToFrames(&file);
  Describe(file, "see mvstudio session timeline", &result);
  Write(file, arguments, &result);
  return result;
}

CommandResult RunMotion(const Arguments& arguments, const stages::FoundTake& found, CommandContext& context,
                        CommandResult result) {
  const auto& footage = found.take.footage;
  std::vector<dataset::MotionEnergy> motion(footage.size());
  {
    ProgressStage stage(context.run, "looking for movement", static_cast<int64_t>(footage.size()));
    ParallelFor(static_cast<int64_t>(footage.size()), context.run.num_threads, [&](int64_t i) {
      const dataset::SessionFootage& f = footage[static_cast<size_t>(i)];
      const std::string path = dataset::ResolveInSession(found.session, f.path, arguments.session.allow_outside);
      motion[static_cast<size_t>(i)] = dataset::ReadMotionEnergy(dataset::ReadFootageTimes(f.camera, path, 30));
    });
  }
  dataset::MotionSyncOptions options;
  options.reference = arguments.options.reference;
  options.max_offset_frames = arguments.options.max_offset_frames;
  const dataset::MotionSync sync = dataset::SynchronizeByMotion(motion, options);
  dataset::SyncFile file = dataset::ToSyncFile(sync);
  if (arguments.fps > 0) file.fps = arguments.fps;
  Describe(file, "film people who move, in no regular rhythm; or use 2D poses", &result);
  for (size_t i = 0; i < sync.cameras.size(); ++i) {
    result.metrics["cameras"][i]["correlation"] = FiniteOrNull(sync.cameras[i].correlation);
    result.metrics["cameras"][i]["runner_up"] = FiniteOrNull(sync.cameras[i].runner_up);
  }
  Write(file, arguments, &result);
  return result;
}

CommandResult Run(Arguments arguments, CommandContext& context) {
  if (arguments.fps != 0 && !dataset::IsFrameRate(arguments.fps))
    throw UsageError(std::string("--fps ") + dataset::kFrameRates);
  CommandResult result;
  if (!arguments.project.empty()) stages::FillFromProject(arguments.project, arguments.session, &arguments.pose, &result);
  const auto found = arguments.project.empty() ? FillFromSession(&arguments, &result) : std::nullopt;
  if (arguments.out.empty()) throw UsageError("--out is required, or a --session to write to");
  const OutputFolder place(
      arguments.out, Joined(PathsIn(arguments.pose.pose2d), {arguments.pose.points2d, arguments.pose.calib}), {"sync.json"});
  result.folder = arguments.out;
  if (arguments.from == "poses") return RunPoses(arguments, found, context, std::move(result));
  if (!found) throw UsageError("--from " + arguments.from + " needs --session");
  return arguments.from == "motion-energy" ? RunMotion(arguments, *found, context, std::move(result))
                                           : RunTimestamps(arguments, *found, context, std::move(result));
}

}  // namespace

void RegisterSync(CLI::App& app, Registry& registry) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub =
      app.add_subcommand("sync", "Time offsets of the cameras: from people who move in the take, or from time stamps");
  StartGroup(sub, "Calibration and 2D joints");
  AddPoseArguments(sub, arguments->pose);
  sub->get_option("--calib")->required(false);
  StartGroup(sub, "Session");
  AddSessionArguments(sub, arguments->session, "calibration, poses and footage", "people");
  AddOption(sub, "--project", arguments->project,
            "folder of an anipose, caliscope or Pose2Sim project instead: calibration and 2D points come from it; --take names "
            "one of "
            "its takes");
  StartGroup(sub, "Offsets");
  AddOption(sub, "--from", arguments->from,
            "poses: people's 2D joints; timestamps: the take's table of times; timecodes: of the videos, to a frame; "
            "motion-energy: images only, coarse")
      ->transform(OneOf({"poses", "timestamps", "timecodes", "motion-energy"}))
      ->capture_default_str();
  AddOption(sub, "--fps,--frame-rate", arguments->fps,
            "Hz; frame rate of all cameras; then offsets are searched within 3 s and given in ms, too");
  AddOptions(sub, arguments->options);
  StartGroup(sub, "Output");
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder, "folder for sync.json; SESSION/sync/TAKE unless given");
  registry.Add(sub, "sync", [arguments, sub](CommandContext& context) {
    arguments->range_given = sub->count("--max-offset-frames") > 0;
    return Run(*arguments, context);
  });
}

}  // namespace mvstudio::cli
