#include "stages/input/first_frames.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "core/error.h"
#include "core/join.h"

namespace mvstudio::stages {
namespace {

using dataset::FirstNumber;
using dataset::Pose2dTrack;

/// Those of `tracks` without a gap from `first`, by their number of frames.
std::map<size_t, std::vector<Pose2dTrack*>> GaplessFrom(int first, std::vector<Pose2dTrack>* tracks) {
  constexpr size_t kFewest = 5;
  std::map<size_t, std::vector<Pose2dTrack*>> found;
  for (Pose2dTrack& track : *tracks) {
    const size_t count = track.frames.size();
    if (count < kFewest || track.frames.begin()->first != first) continue;
    if (track.frames.rbegin()->first == first + static_cast<int>(count) - 1) found[count].push_back(&track);
  }
  return found;
}

void NumberAsFootage(const std::vector<NamedPath>& footage, std::vector<Pose2dTrack>* tracks, InputNotes* notes) {
  for (Pose2dTrack& track : *tracks) {
    const auto of_camera = [&](const NamedPath& named) { return named.name == track.camera; };
    const auto found = std::find_if(footage.begin(), footage.end(), of_camera);
    if (found == footage.end() || track.frames.empty() || track.frames.begin()->first < 1) continue;
    std::set<int64_t> numbers;
    for (const auto& [number, people] : track.frames) numbers.insert(number);
    const std::optional<int64_t> num_frames = dataset::FramesFrom0(found->path);
    const FirstNumber first = num_frames ? dataset::FirstNumberOf(numbers, *num_frames) : FirstNumber::kAsFrames;
    if (first == FirstNumber::kOne) CountFrom(1, &track);
    TellFirstNumber(first, "joints of " + track.camera, notes);
  }
}

void NumberAsOthers(std::vector<Pose2dTrack>* tracks, InputNotes* notes) {
  auto from_zero = GaplessFrom(0, tracks);
  for (auto& [count, from_one] : GaplessFrom(1, tracks)) {
    const auto others = from_zero.find(count);
    if (others == from_zero.end()) continue;
    const auto name = [](const Pose2dTrack* track) { return track->camera; };
    const std::string n = std::to_string(count), last = std::to_string(count - 1);
    notes->warnings.push_back({"POSE-FIRST",
                               "frames of " + Join(from_one, ", ", name) + " are numbered 1 to " + n + ", those of " +
                                   Join(others->second, ", ", name) + " 0 to " + last +
                                   ": frame 1 of the former was taken for frame 0, since their programs count from 1",
                               "if the numbers are right as they are, option 'first-frame' 0 says so"});
    for (Pose2dTrack* track : from_one) CountFrom(1, track);
  }
}

}  // namespace

void CountFrom(int first, Pose2dTrack* track) {
  if (!track->frames.empty() && track->frames.begin()->first < first)
    throw FormatError("camera " + track->camera, "frame " + std::to_string(track->frames.begin()->first),
                      "is before option 'first-frame' " + std::to_string(first) + ", the number of the first frame");
  std::map<int, std::vector<dataset::Person2d>> frames;
  for (auto& [number, people] : track->frames) frames.emplace_hint(frames.end(), number - first, std::move(people));
  track->frames = std::move(frames);
}

void NumberFromZero(const PoseChanges& changes, const std::vector<NamedPath>& footage, std::vector<Pose2dTrack>* tracks,
                    InputNotes* notes) {
  if (!changes.first_frame.empty()) {
    for (Pose2dTrack& track : *tracks) CountFrom(FirstFrameOf(changes, track.camera), &track);
    return;
  }
  NumberAsFootage(footage, tracks, notes);
  NumberAsOthers(tracks, notes);
}

void TellFirstNumber(FirstNumber first, const std::string& whose, InputNotes* notes) {
  if (first == FirstNumber::kOne)
    notes->warnings.push_back(
        {"POSE-FIRST", whose + " are of frames 1 to N, and the footage has N, from 0: frame 1 was taken for the first one",
         "option 'first-frame' 1 says so, too"});
  if (first == FirstNumber::kUnclear)
    notes->warnings.push_back(
        {"POSE-FIRST",
         whose + " are of frames from 1, or beyond the last, and the footage counts from 0: frame 1 was taken "
                 "for the second one",
         "if their program counts from 1, option 'first-frame' 1 says so, else 0"});
}

}  // namespace mvstudio::stages
