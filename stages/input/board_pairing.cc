#include "stages/input/board_pairing.h"

#include "core/format.h"

namespace mvstudio::stages {
namespace {

int64_t DroppedIn(const dataset::Timeline& timeline) {
  int64_t dropped = 0;
  for (const dataset::CameraTimeline& camera : timeline.cameras) {
    for (const dataset::DroppedFrames& gap : camera.dropped) dropped += gap.count;
  }
  return dropped;
}

std::string ClockText(dataset::TimelineClock clock) {
  if (clock == dataset::TimelineClock::kCommon) return "time stamps on one clock";
  if (clock == dataset::TimelineClock::kOffsets) return "offsets and each camera's own time stamps";
  return "each camera's own time stamps, all starting at once";
}

}  // namespace

void PairByTime(const dataset::Timeline& timeline, std::vector<calib::Footage>* footage, InputNotes* notes) {
  for (calib::Footage& f : *footage) {
    const dataset::CameraTimeline* camera = timeline.Find(f.camera);
    if (camera) f.step_of_frame = dataset::TimeStepOfEachFrame(*camera);
    if (!f.step_of_frame.empty()) continue;
    const std::string why = camera ? std::string(ToString(camera->status)) : "not listed";
    notes->warnings.push_back(
        {"CAL-PAIRING",
         "camera " + f.camera + " has no place in the timeline (" + why + "): its boards are paired by frame number",
         "run mvstudio session timeline for this take, or sync it first"});
  }
}

nlohmann::ordered_json PairingJson(const dataset::Timeline* timeline) {
  if (!timeline) return {{"by", "number"}};
  return {{"by", "time"},
          {"clock", dataset::ToString(timeline->clock)},
          {"reference", timeline->reference},
          {"dropped", DroppedIn(*timeline)}};
}

std::string PairingText(const dataset::Timeline* timeline) {
  if (!timeline) return "boards are paired by frame number\n";
  return Format("boards are paired by time: %s; %lld frames were dropped\n", ClockText(timeline->clock).c_str(),
                static_cast<long long>(DroppedIn(*timeline)));
}

}  // namespace mvstudio::stages
