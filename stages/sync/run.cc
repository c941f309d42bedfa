#include "stages/sync/run.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "core/disk/output.h"
#include "core/error.h"
#include "core/join.h"
#include "core/parallel.h"
#include "dataset/footage/frame_rate.h"
#include "dataset/footage/frames.h"
#include "dataset/session/timeline_source.h"
#include "geometry/rig/rig_covariance.h"
#include "stages/input/take_frames.h"

namespace mvstudio::stages {
namespace {

using triangulate::CameraSync;
using triangulate::SyncResult;
using triangulate::SyncStatus;

/// Whole frames by which each camera's numbers lead the reference's.
using FrameOffsets = std::map<std::string, int>;

/// The cameras that have poses; others have no clock to find.
geometry::Rig FilmedRig(const geometry::Rig& rig, const std::vector<dataset::Pose2dTrack>& tracks) {
  std::vector<size_t> filmed;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const auto of_camera = [&](const auto& track) { return track.camera == rig.cameras[c].camera.name; };
    if (std::any_of(tracks.begin(), tracks.end(), of_camera)) filmed.push_back(c);
  }
  return geometry::SubsetOf(rig, filmed);
}

dataset::SyncFile SyncFileOf(const SyncResult& sync, double fps_hz) {
  dataset::SyncFile file;
  file.reference = sync.cameras[static_cast<size_t>(sync.reference_idx)].name;
  if (fps_hz > 0) file.fps = fps_hz;
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

/// What the session and its take say, in place of the options that were not given.
std::optional<FoundTake> FillSyncFromSession(SyncOptions* options, InputNotes* notes) {
  std::optional<FoundTake> found = FindTake(options->session, notes);
  if (!found) return found;
  if (options->out.empty()) options->out = dataset::TakeFolder(found->session, "sync", found->take.name);
  if (options->fps_hz <= 0) options->fps_hz = found->take.fps_hz.value_or(found->session.fps_hz.value_or(0));
  if (options->from != SyncSource::kPoses) return found;
  const bool own = !options->pose.pose2d.empty();
  FillPoses(*found, options->session, &options->pose);
  if (!own) LeaveOutUncalibrated(&options->pose, notes);
  return found;
}

/// Detectors number the frames that were recorded; dropped ones must count too.
void CountDropped(const FoundTake& found, const SyncOptions& options, PoseInput* input, InputNotes* notes) {
  if (!RenumberByClock(found, options.session, input)) return;
  input->frames = ToFrames(input->tracks, input->rig, options.pose.calib);
  notes->warnings.push_back({"SYN-DROPPED", "cameras dropped or doubled frames: offsets count the time steps of their clocks",
                             "see mvstudio session timeline"});
}

/// By the videos' time codes; empty unless all have one.
FrameOffsets OffsetsByTimeCodes(const FoundTake& found, const SyncOptions& options) {
  dataset::TakeTimelineOptions timeline;
  timeline.allow_outside = options.session.allow_outside;
  timeline.time_codes = true;
  for (const dataset::SessionFootage& f : found.take.footage) {
    const std::string path = dataset::ResolveInSession(found.session, f.path, timeline.allow_outside);
    if (!dataset::DescribeFootage(path).time_code_s) return {};
  }
  FrameOffsets offsets;
  try {
    const dataset::TakeTimeline made = dataset::BuildTakeTimeline(found.session, found.take, timeline);
    for (const dataset::SyncedCamera& camera : dataset::SyncFromTimeline(made.timeline).cameras) {
      if (!camera.offset_frames) return {};
      offsets[camera.name] = static_cast<int>(std::lround(*camera.offset_frames));
    }
  } catch (const UsageError&) {  // no time codes
  }
  return offsets;
}

/// Moves the frames so that those of one time code have one number, the earliest camera's numbers staying.
void AlignByTimeCodes(const FrameOffsets& offsets, PoseInput* input) {
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
void UndoAlignment(const FrameOffsets& offsets, SyncResult* sync) {
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

triangulate::SyncOptions SearchOf(const SyncOptions& options) {
  constexpr double kRangeSeconds = 3;
  triangulate::SyncOptions search = options.search;
  if (options.fps_hz > 0 && !options.keep_range)
    search.max_offset_frames = static_cast<int>(std::lround(kRangeSeconds * options.fps_hz));
  return search;
}

void SyncByPoses(const SyncOptions& options, const std::optional<FoundTake>& found, const RunContext& run, SyncReport* report) {
  if (options.pose.calib.empty())
    throw UsageError("option 'calib' is required, or a session that has a calibration (option 'session')");
  PoseInput input = ReadPoseInput(options.pose, &report->notes);
  if (found) CountDropped(*found, options, &input, &report->notes);
  const FrameOffsets first = found ? OffsetsByTimeCodes(*found, options) : FrameOffsets{};
  if (!first.empty()) {
    AlignByTimeCodes(first, &input);
    input.frames = ToFrames(input.tracks, input.rig, options.pose.calib);
  }
  report->began_by_time_codes = !first.empty();
  const geometry::Rig filmed = FilmedRig(input.rig, input.tracks);
  if (filmed.cameras.size() != input.rig.cameras.size()) input.frames = ToFrames(input.tracks, filmed, options.pose.calib);
  SyncResult sync = SynchronizeCameras(triangulate::Prepare(filmed), input.frames, SearchOf(options), run);
  UndoAlignment(first, &sync);
  report->file = SyncFileOf(sync, options.fps_hz);
  report->by_poses = std::move(sync);
}

/// A time code counts whole frames: the difference of two has the spread of that of two uniform frames.
void WidenToFrames(dataset::SyncFile* file) {
  const double sigma_frames = std::sqrt(2.0 / 12);
  for (dataset::SyncedCamera& camera : file->cameras) {
    if (camera.name != file->reference) camera.sigma_frames = std::max(camera.sigma_frames, sigma_frames);
  }
}

void SyncByTimestamps(const SyncOptions& options, const FoundTake& found, const RunContext& run, SyncReport* report) {
  const bool by_codes = options.from == SyncSource::kTimecodes;
  if (!by_codes && found.take.timestamps.empty()) {
    throw UsageError("take " + found.take.name + " names no table of time stamps: timestamps = \"FILE.csv\" in mvstudio.toml");
  }
  dataset::TakeTimelineOptions timeline;
  timeline.allow_outside = options.session.allow_outside;
  timeline.timeline.reference = options.search.reference;
  timeline.time_codes = by_codes;
  const dataset::TakeTimeline made = dataset::BuildTakeTimeline(found.session, found.take, timeline, run);
  for (const std::string& note : made.notes) report->notes.warnings.push_back({"SES-TIMELINE", note, ""});
  report->file = dataset::SyncFromTimeline(made.timeline);
  if (by_codes) WidenToFrames(&report->file);
}

void SyncByMotion(const SyncOptions& options, const FoundTake& found, const RunContext& run, SyncReport* report) {
  const auto& footage = found.take.footage;
  std::vector<dataset::MotionEnergy> motion(footage.size());
  {
    ProgressStage stage(run, "looking for movement", static_cast<int64_t>(footage.size()));
    ParallelFor(static_cast<int64_t>(footage.size()), run.num_threads, [&](int64_t i) {
      const dataset::SessionFootage& f = footage[static_cast<size_t>(i)];
      const std::string path = dataset::ResolveInSession(found.session, f.path, options.session.allow_outside);
      motion[static_cast<size_t>(i)] = dataset::ReadMotionEnergy(dataset::ReadFootageTimes(f.camera, path, 30));
    });
  }
  dataset::MotionSyncOptions search;
  search.reference = options.search.reference;
  search.max_offset_frames = options.search.max_offset_frames;
  report->by_motion = dataset::SynchronizeByMotion(motion, search);
  report->file = dataset::ToSyncFile(*report->by_motion);
  if (options.fps_hz > 0) report->file.fps = options.fps_hz;
}

std::vector<std::string> InputsOfSync(const SyncOptions& options) {
  std::vector<std::string> paths;
  for (const NamedPath& camera : options.pose.pose2d) paths.push_back(camera.path);
  paths.insert(paths.end(), {options.pose.points2d, options.pose.calib});
  return paths;
}

}  // namespace

int SyncReport::num_ok() const {
  return static_cast<int>(std::count_if(file.cameras.begin(), file.cameras.end(),
                                        [](const auto& camera) { return camera.offset_frames.has_value(); }));
}

bool SyncReport::Failed() const { return num_ok() < static_cast<int>(file.cameras.size()) && num_ok() <= (by_poses ? 0 : 1); }

SyncReport RunSync(SyncOptions options, const RunContext& run) {
  if (options.fps_hz != 0 && !dataset::IsFrameRate(options.fps_hz))
    throw UsageError(std::string("option 'fps' ") + dataset::kFrameRates);
  SyncReport report;
  if (!options.project.empty())
    report.project = FillFromProject(options.project, options.session, &options.pose, &report.notes);
  const auto found = options.project.empty() ? FillSyncFromSession(&options, &report.notes) : std::nullopt;
  if (options.out.empty()) throw UsageError("option 'out' is required, or a session to write to (option 'session')");
  const OutputFolder place(options.out, InputsOfSync(options), {"sync.json"});
  report.from = options.from, report.fps_hz = options.fps_hz;
  if (options.from == SyncSource::kPoses) {
    SyncByPoses(options, found, run, &report);
  } else if (!found) {
    throw UsageError("option 'from' " + std::string(ToString(options.from)) + " needs option 'session'");
  } else if (options.from == SyncSource::kMotionEnergy) {
    SyncByMotion(options, *found, run, &report);
  } else {
    SyncByTimestamps(options, *found, run, &report);
  }
  report.folder = options.out, report.path = (std::filesystem::path(options.out) / "sync.json").string();
  report.kept_older = report.Failed() && std::filesystem::exists(report.path);
  if (!report.kept_older) dataset::WriteSync(report.file, report.path);
  return report;
}

}  // namespace mvstudio::stages
