#include "dataset/session/timeline_source.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "core/error.h"
#include "core/parallel.h"
#include "core/statistics.h"
#include "dataset/footage/chapters.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/video_io.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

constexpr double kUsualFps = 30;

int LargestChange(const Image& a, const Image& b) {
  int largest = 0;
  for (size_t i = 0; i < std::min(a.pixels.size(), b.pixels.size()); ++i) {
    largest = std::max(largest, std::abs(int{a.pixels[i]} - int{b.pixels[i]}));
  }
  return largest;
}

double MedianAround(const std::vector<int>& values, size_t at, size_t reach) {
  std::vector<int> around;
  for (size_t i = at > reach ? at - reach : 1; i < std::min(values.size(), at + reach + 1); ++i) {
    if (i != at) around.push_back(values[i]);
  }
  return UpperMedian(std::move(around), 0);
}

void AddNotes(const Timeline& timeline, std::vector<std::string>* notes) {
  for (const CameraTimeline& c : timeline.cameras) {
    if (c.status == ClockStatus::kVariable)
      notes->push_back("camera " + c.name + ": no regular frame rate; its frames are taken by time alone");
    if (c.status == ClockStatus::kNoTime) notes->push_back("camera " + c.name + ": no usable time stamps: it takes no part");
    if (c.status == ClockStatus::kNoOffset)
      notes->push_back("camera " + c.name + ": the sync file has no offset for it: it takes no part");
    int64_t dropped = 0;
    for (const DroppedFrames& d : c.dropped) dropped += d.count;
    if (dropped > 0) notes->push_back("camera " + c.name + ": " + std::to_string(dropped) + " frames were dropped");
    if (!c.doubled.empty())
      notes->push_back("camera " + c.name + ": " + std::to_string(c.doubled.size()) + " frames are doubles");
    if (!c.bad_times.empty()) {
      notes->push_back("camera " + c.name + ": " + std::to_string(c.bad_times.size()) +
                       " time stamps are missing or contradict the others");
    }
  }
}

/// Time of the first or last frame that has one; NaN: none.
template <class Iterator>
double FirstFinite(Iterator begin, Iterator end) {
  const auto found = std::find_if(begin, end, [](double t) { return std::isfinite(t); });
  return found == end ? std::nan("") : *found;
}

/// Whether the offset of any of the cameras is known.
bool KnowsAny(const SyncFile& sync, const std::vector<CameraTimes>& times) {
  std::vector<std::string> names;
  for (const CameraTimes& camera : times) names.push_back(camera.camera);
  const std::vector<double> offsets = OffsetsOf(sync, names);
  return std::any_of(offsets.begin(), offsets.end(), [](double offset) { return std::isfinite(offset); });
}

/// How the cameras' clocks relate; time stamps of a table, or of time codes, replace the cameras' own.
TimelineClock RelateClocks(const Session& session, const SessionTake& take, const TakeTimelineOptions& options,
                           std::vector<CameraTimes>* times, std::optional<SyncFile>* sync, std::vector<std::string>* notes) {
  if (options.time_codes) {
    if (PlaceByTimeCodes(times)) return TimelineClock::kCommon;
    throw UsageError("take " + take.name +
                     ": not every camera's video has a time code, or they film at different times by them");
  }
  if (!take.timestamps.empty()) {
    *notes = ReadTimestamps(ResolveInSession(session, take.timestamps, options.allow_outside), session.cameras, times);
    return TimelineClock::kCommon;
  }
  const std::string sync_path = SyncPathOf(session, take, options.allow_outside);
  if (!sync_path.empty()) {
    *sync = ReadSync(sync_path);
    if (KnowsAny(**sync, *times)) return TimelineClock::kOffsets;
    sync->reset();
    notes->push_back(sync_path + " knows the offset of no camera and is left out");
  }
  if (PlaceByTimeCodes(times)) {
    notes->push_back(
        "the cameras' clocks are related by the videos' time codes, which count whole frames: offsets may be off by one; "
        "mvstudio sync finds the rest");
    return TimelineClock::kCommon;
  }
  notes->push_back(
      "nothing relates the cameras' clocks: their first frames are taken to be one time step; run mvstudio sync, "
      "or name a table of time stamps");
  return TimelineClock::kStart;
}

/// `cut_short`, if not null: why the video ends before its last frame; empty: it does not.
CameraTimes ReadTimes(const std::string& camera, const std::string& path, double image_fps_hz, std::string* cut_short) {
  CameraTimes times;
  times.camera = camera;
  times.source = path;
  const FootageFiles files = ListFootage(path);
  if (files.is_video) {
    VideoTimes video = ReadVideoTimes(files.paths);
    times.time_s = std::move(video.time_s);
    times.time_code_s = video.time_code_s;
    if (cut_short) *cut_short = std::move(video.cut_short);
    for (size_t i = 0; i < times.time_s.size(); ++i) times.frame.push_back(static_cast<int64_t>(i));
    return times;
  }
  times.origin_s = 0;
  for (size_t i = 0; i < files.paths.size(); ++i) {
    const int64_t number = files.images.numbers[i];
    if (!times.frame.empty() && number <= times.frame.back())
      RefuseOrder(path, fs::path(files.paths[i]).filename().string(), number, times.frame.back());
    times.frame.push_back(number);
    times.time_s.push_back(static_cast<double>(number) / image_fps_hz);
  }
  return times;
}

}  // namespace

bool PlaceByTimeCodes(std::vector<CameraTimes>* times) {
  constexpr double kDayS = 24 * 3600;
  std::vector<double> shifts_s;
  double latest_start_s = -INFINITY, earliest_end_s = INFINITY;
  for (const CameraTimes& camera : *times) {
    const double first_s = FirstFinite(camera.time_s.begin(), camera.time_s.end());
    if (!camera.time_code_s || !std::isfinite(first_s)) return false;
    const double start_s =
        *times->front().time_code_s + std::remainder(*camera.time_code_s - *times->front().time_code_s, kDayS);
    shifts_s.push_back(start_s - first_s);
    latest_start_s = std::max(latest_start_s, start_s);
    earliest_end_s = std::min(earliest_end_s, FirstFinite(camera.time_s.rbegin(), camera.time_s.rend()) + shifts_s.back());
  }
  if (times->size() < 2 || !(latest_start_s < earliest_end_s)) return false;
  for (size_t c = 0; c < times->size(); ++c) {
    for (double& t : (*times)[c].time_s) t += shifts_s[c];
  }
  return true;
}

CameraTimes ReadFootageTimes(const std::string& camera, const std::string& path, double image_fps_hz) {
  return ReadTimes(camera, path, image_fps_hz, nullptr);
}

std::vector<int64_t> FindRepeats(const std::string& path) {
  constexpr int kSide = 160;
  constexpr double kShare = 0.125, kLeastMotion = 6;
  constexpr size_t kReach = 6;
  std::vector<int> change;
  std::vector<int64_t> numbers, repeats;
  const auto source = OpenFrames(path);
  Image before;
  while (const auto frame = source->Advance()) {
    Image now = source->Thumbnail(kSide);
    change.push_back(before.empty() ? 0 : LargestChange(before, now));
    numbers.push_back(frame->number);
    before = std::move(now);
  }
  for (size_t i = 1; i < change.size(); ++i) {
    const double usual = MedianAround(change, i, kReach);
    if (usual >= kLeastMotion && change[i] <= kShare * usual) repeats.push_back(numbers[i]);
  }
  return repeats;
}

std::string SyncPathOf(const Session& session, const SessionTake& take, bool allow_outside) {
  if (!take.sync.empty()) return ResolveInSession(session, take.sync, allow_outside);
  const std::string usual = "sync/" + Slug(take.name) + "/sync.json";
  return fs::exists(fs::path(session.folder) / usual) ? ResolveInSession(session, usual, allow_outside) : "";
}

TakeTimeline BuildTakeTimeline(const Session& session, const SessionTake& take, const TakeTimelineOptions& options,
                               const RunContext& run) {
  if (take.footage.empty()) throw UsageError("take " + take.name + " has no footage");
  TakeTimeline result;
  const double fps = take.fps_hz.value_or(session.fps_hz.value_or(kUsualFps));
  std::vector<CameraTimes> times(take.footage.size());
  std::vector<std::string> paths, cut_short(times.size());
  for (const SessionFootage& f : take.footage) paths.push_back(ResolveInSession(session, f.path, options.allow_outside));
  ProgressStage stage(run, "reading time stamps", static_cast<int64_t>(times.size()));
  ParallelFor(static_cast<int64_t>(times.size()), run.num_threads, [&](int64_t i) {
    const auto k = static_cast<size_t>(i);
    times[k] = ReadTimes(take.footage[k].camera, paths[k], fps, &cut_short[k]);
    if (options.find_repeats) times[k].repeats = FindRepeats(paths[k]);
  });
  std::optional<SyncFile> sync;
  const TimelineClock clock = RelateClocks(session, take, options, &times, &sync, &result.notes);
  result.timeline = BuildTimeline(times, clock, sync ? &*sync : nullptr, options.timeline);
  result.timeline.take = take.name;
  // As the session names it: what the file says is the same by whichever name the session's folder was given.
  for (size_t i = 0; i < times.size(); ++i) result.timeline.cameras[i].source = take.footage[i].path;
  AddNotes(result.timeline, &result.notes);
  for (size_t i = 0; i < times.size(); ++i) {
    if (cut_short[i].empty()) continue;
    result.notes.push_back("camera " + times[i].camera + ": its video is damaged after " +
                           std::to_string(times[i].frame.size()) + " frames (" + cut_short[i] + "): copy it again");
  }
  return result;
}

}  // namespace mvstudio::dataset
