#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/fields.h"
#include "dataset/json/json_file.h"
#include "dataset/time/timeline.h"

namespace mvstudio::dataset {
namespace {

using internal::Json;
using internal::JsonView;

constexpr ChoiceWords<ClockStatus, 4> kClockStatuses = {{{ClockStatus::kOk, "Ok"},
                                                         {ClockStatus::kVariable, "Variable"},
                                                         {ClockStatus::kNoTime, "NoTime"},
                                                         {ClockStatus::kNoOffset, "NoOffset"}}};

constexpr char kSchema[] = "mvstudio.timeline/1";
constexpr double kMaxTimeSteps = 2e6, kMaxNumber = 9e15;

double Finite(double value) {
  MVS_CHECK(std::isfinite(value), "a timeline's number is not finite");
  return value;
}

/// Intervals in which frames and time steps advance together: [first time step, its frame, how many].
Json Runs(const std::vector<int64_t>& frame_at) {
  Json runs = Json::array();
  for (size_t i = 0; i < frame_at.size();) {
    size_t end = i + 1;
    while (end < frame_at.size() && frame_at[i] >= 0 && frame_at[end] == frame_at[i] + static_cast<int64_t>(end - i)) ++end;
    if (frame_at[i] >= 0) runs.push_back({i, frame_at[i], end - i});
    i = end;
  }
  return runs;
}

Json CameraJson(const CameraTimeline& c) {
  Json json{{"name", c.name}, {"source", c.source}, {"status", ToString(c.status)}, {"frames", c.num_frames}};
  json["fps_hz"] = Finite(c.fps_hz);
  json["offset_frames"] = Finite(c.offset_frames);
  json["sigma_frames"] = Finite(c.sigma_frames);
  json["rate_ppm"] = Finite(c.rate_ppm);
  json["rate_sigma_ppm"] = Finite(c.rate_sigma_ppm);
  json["jitter_ms"] = Finite(c.jitter_ms);
  json["residual_ms"] = {{"median", Finite(c.residual_median_ms)}, {"max", Finite(c.residual_max_ms)}};
  json["dropped"] = Json::array();
  for (const DroppedFrames& d : c.dropped) json["dropped"].push_back({d.after, d.count});
  json["doubled"] = c.doubled;
  json["bad_times"] = c.bad_times;
  json["instants"] = Runs(c.frame_at);
  return json;
}

int64_t Whole(const JsonView& json, double least, double most) {
  const double value = json.Number();
  if (value != std::floor(value) || value < least || value > most) {
    json.Fail("must be a whole number from " + internal::NumberText(least) + " to " + internal::NumberText(most));
  }
  return static_cast<int64_t>(value);
}

std::vector<int64_t> Frames(const JsonView& json) {
  std::vector<int64_t> frames;
  for (size_t i = 0; i < json.ArraySize(); ++i) frames.push_back(Whole(json[i], 0, kMaxNumber));
  return frames;
}

void ReadRuns(const JsonView& json, std::vector<int64_t>* frame_at) {
  const double total = static_cast<double>(frame_at->size());
  int64_t end = 0;
  for (size_t i = 0; i < json.ArraySize(); ++i) {
    const JsonView run = json[i];
    if (run.ArraySize() != 3) run.Fail("must be [instant, frame, count]");
    const int64_t first = Whole(run[size_t{0}], 0, total - 1), frame = Whole(run[1], 0, kMaxNumber);
    const int64_t count = Whole(run[2], 1, total - static_cast<double>(first));
    if (first < end) run.Fail("begins before the run before it ends");
    end = first + count;
    for (int64_t k = 0; k < count; ++k) (*frame_at)[static_cast<size_t>(first + k)] = frame + k;
  }
}

CameraTimeline ReadCamera(const JsonView& json, size_t num_time_steps) {
  CameraTimeline c;
  c.name = internal::CameraName(json["name"]);
  c.source = json["source"].Text();
  const std::optional<ClockStatus> status = ClockStatusFromString(json["status"].Text());
  if (!status) json["status"].Fail("must be Ok, Variable, NoTime or NoOffset");
  c.status = *status;
  c.num_frames = Whole(json["frames"], 0, kMaxNumber);
  c.fps_hz = json["fps_hz"].Number();
  c.offset_frames = json["offset_frames"].Number();
  c.sigma_frames = json["sigma_frames"].Number();
  c.rate_ppm = json["rate_ppm"].Number();
  c.rate_sigma_ppm = json["rate_sigma_ppm"].Number();
  c.jitter_ms = json["jitter_ms"].Number();
  c.residual_median_ms = json["residual_ms"]["median"].Number();
  c.residual_max_ms = json["residual_ms"]["max"].Number();
  const JsonView dropped = json["dropped"];
  for (size_t i = 0; i < dropped.ArraySize(); ++i) {
    if (dropped[i].ArraySize() != 2) dropped[i].Fail("must be [frame, count]");
    c.dropped.push_back({Whole(dropped[i][size_t{0}], 0, kMaxNumber), Whole(dropped[i][1], 1, kMaxNumber)});
  }
  c.doubled = Frames(json["doubled"]);
  c.bad_times = Frames(json["bad_times"]);
  c.frame_at.assign(num_time_steps, -1);
  ReadRuns(json["instants"], &c.frame_at);
  return c;
}

TimelineClock ReadClock(const JsonView& json) {
  for (const TimelineClock clock : {TimelineClock::kCommon, TimelineClock::kOffsets, TimelineClock::kStart}) {
    if (json.Text() == ToString(clock)) return clock;
  }
  json.Fail("must be common, offsets or start");
}

}  // namespace

std::string_view ToString(ClockStatus status) { return WordOf(kClockStatuses, status); }
std::optional<ClockStatus> ClockStatusFromString(std::string_view text) { return ChoiceOf(kClockStatuses, text); }

void WriteTimeline(const Timeline& timeline, const std::string& path) {
  Json json{{"schema", kSchema}, {"take", timeline.take}, {"reference", timeline.reference}};
  json["clock"] = ToString(timeline.clock);
  json["fps_hz"] = Finite(timeline.fps_hz);
  json["start_s"] = Finite(timeline.start_s);
  json["num_instants"] = timeline.num_time_steps;
  json["cameras"] = Json::array();
  for (const CameraTimeline& c : timeline.cameras) json["cameras"].push_back(CameraJson(c));
  WriteFileAtomic(path, json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

Timeline ReadTimeline(const std::string& path) {
  const Json json = internal::ParseJsonFile(path);
  const JsonView view(path, json);
  if (view["schema"].Text() != kSchema) view["schema"].Fail(std::string("must be ") + kSchema);
  Timeline timeline;
  timeline.take = view["take"].Text();
  timeline.reference = view["reference"].Text();
  timeline.clock = ReadClock(view["clock"]);
  timeline.fps_hz = view["fps_hz"].Number();
  if (!(timeline.fps_hz > 0)) view["fps_hz"].Fail("must be positive");
  timeline.start_s = view["start_s"].Number();
  timeline.num_time_steps = Whole(view["num_instants"], 0, kMaxTimeSteps);
  const JsonView cameras = view["cameras"];
  constexpr double kMaxEntries = 6.5e7;
  if (static_cast<double>(cameras.ArraySize()) * static_cast<double>(timeline.num_time_steps) > kMaxEntries) {
    cameras.Fail("too many cameras for so many time steps");
  }
  for (size_t i = 0; i < cameras.ArraySize(); ++i) {
    timeline.cameras.push_back(ReadCamera(cameras[i], static_cast<size_t>(timeline.num_time_steps)));
  }
  if (!timeline.Find(timeline.reference)) view["reference"].Fail("is none of the cameras");
  return timeline;
}

}  // namespace mvstudio::dataset
