#include <cmath>

#include "core/disk/files.h"
#include "dataset/session/timeline_source.h"
#include "dataset/time/timeline.h"
#include "dataset/views/split.h"
#include "tests/fuzz/fuzz.h"

/// Files about a take: which frame shows which time step, and which belong to training.
namespace mvstudio::fuzz {

MVS_FUZZ_TARGET(timeline_json, bytes) {
  const std::string path = InMemory("take.timeline.json", bytes);
  dataset::Timeline timeline;
  if (!Accepts([&] { timeline = dataset::ReadTimeline(path); })) return;
  for (const dataset::CameraTimeline& camera : timeline.cameras) {
    Require(static_cast<int64_t>(camera.frame_at.size()) == timeline.num_time_steps, "a camera of another number of instants");
  }
  const std::string out = MemoryPath("out.timeline.json"), again = MemoryPath("again.timeline.json");
  dataset::WriteTimeline(timeline, out);
  Require(Accepts([&] { dataset::WriteTimeline(dataset::ReadTimeline(out), again); }), "what was written cannot be read");
  Require(ReadFile(out) == ReadFile(again), "the timeline changes when it is read and written again");
}

MVS_FUZZ_TARGET(timestamps_csv, bytes) {
  const std::string path = InMemory("times.csv", bytes);
  const std::vector<dataset::SessionCamera> cameras = {{"cam_01", "123", "", 0, 0}, {"b", "", "", 0, 0}};
  std::vector<dataset::CameraTimes> times(2);
  times[0].camera = "cam_01", times[0].frame = {0, 1, 2};
  times[1].camera = "b", times[1].frame = {5, 6};
  for (dataset::CameraTimes& camera : times) camera.time_s.assign(camera.frame.size(), std::nan(""));
  if (!Accepts([&] { dataset::ReadTimestamps(path, cameras, &times); })) return;
  for (const dataset::CameraTimes& camera : times) {
    Require(camera.time_s.size() == camera.frame.size(), "times of another number than frames");
  }
  Accepts([&] { dataset::BuildTimeline(times, dataset::TimelineClock::kCommon, nullptr); });
}

MVS_FUZZ_TARGET(split_json, bytes) {
  dataset::Split split;
  if (!Accepts([&] { split = dataset::SplitFromJsonText(std::string(bytes), "split.json"); })) return;
  Require(dataset::SplitFaults(split).empty(), "a split with faults was accepted");
  const std::string text = dataset::SplitToJsonText(split);
  Require(dataset::SplitToJsonText(dataset::SplitFromJsonText(text, "again.json")) == text, "the split changes");
}

}  // namespace mvstudio::fuzz
