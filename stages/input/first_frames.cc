#include "stages/input/first_frames.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "core/error.h"
#include "core/join.h"
#include "geometry/rig/lenses_only.h"
#include "stages/input/take_frames.h"
#include "triangulate/sync/sync.h"

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

/// Returns the cameras whose footage says how many frames it has.
std::set<std::string> NumberAsFootage(const std::vector<NamedPath>& footage, std::vector<Pose2dTrack>* tracks,
                                      InputNotes* notes) {
  std::set<std::string> known;
  for (Pose2dTrack& track : *tracks) {
    const auto of_camera = [&](const NamedPath& named) { return named.name == track.camera; };
    const auto found = std::find_if(footage.begin(), footage.end(), of_camera);
    if (found == footage.end() || track.frames.empty() || track.frames.begin()->first < 1) continue;
    std::set<int64_t> numbers;
    for (const auto& [number, people] : track.frames) numbers.insert(number);
    const std::optional<int64_t> num_frames = dataset::FramesFrom0(found->path);
    if (num_frames.value_or(0) > 0) known.insert(track.camera);
    const FirstNumber first = num_frames ? dataset::FirstNumberOf(numbers, *num_frames) : FirstNumber::kAsFrames;
    if (first == FirstNumber::kOne) CountFrom(1, &track);
    ReportFirstNumber(first, "joints of " + track.camera, notes);
  }
  return known;
}

/// Whether the program lists frames without people, too: then its numbers begin and end with the footage.
bool ListsEveryFrame(const Pose2dTrack& track) {
  return track.every_frame ||
         std::any_of(track.frames.begin(), track.frames.end(), [](const auto& frame) { return frame.second.empty(); });
}

/// What the frames of `whose` count from, 0 or 1, by the motion that all cameras see; nothing where it does not tell.
std::optional<int> FirstByMotion(const PoseChanges& changes, const NumberingRig& with, std::vector<Pose2dTrack> tracks,
                                 const std::string& whose) {
  if (!with.rig || !with.skeleton || geometry::HasLensesOnly(*with.rig)) return std::nullopt;
  if (!changes.rate.empty()) return std::nullopt;
  ApplyChanges(changes, *with.rig, *with.skeleton, &tracks);
  triangulate::SyncOptions options;
  options.max_offset_frames = 5, options.find_rates = false;
  const triangulate::SyncResult found =
      triangulate::SynchronizeCameras(triangulate::Prepare(*with.rig), ToFrames(tracks, *with.rig, ""), options);
  const auto of = [&](const std::string& name) {
    const int camera = with.rig->Find(name);
    const auto& cameras = found.cameras;
    return camera < 0 || cameras[static_cast<size_t>(camera)].status != triangulate::SyncStatus::kOk
               ? std::nan("")
               : cameras[static_cast<size_t>(camera)].offset_frames;
  };
  for (const Pose2dTrack& track : tracks) {
    if (track.frames.empty() || track.frames.begin()->first != 0) continue;
    const double later = of(whose) - of(track.camera);  // frames
    if (std::abs(later) < 0.25) return 0;
    if (std::abs(later - 1) < 0.25) return 1;
  }
  return std::nullopt;
}

void NumberAsOthers(const PoseChanges& changes, const std::set<std::string>& known, const NumberingRig& with,
                    std::vector<Pose2dTrack>* tracks, InputNotes* notes) {
  auto from_zero = GaplessFrom(0, tracks);
  std::vector<Pose2dTrack*> ones;
  for (auto& [count, from_one] : GaplessFrom(1, tracks)) {
    const auto others = from_zero.find(count);
    if (others == from_zero.end()) continue;
    const bool counted = std::any_of(others->second.begin(), others->second.end(),
                                     [](const Pose2dTrack* track) { return ListsEveryFrame(*track); });
    for (Pose2dTrack* track : from_one) {
      if (known.count(track->camera)) continue;
      const std::string n = std::to_string(count), last = std::to_string(count - 1);
      const auto name = [](const Pose2dTrack* other) { return other->camera; };
      const std::string begin = "frames of " + track->camera + " are numbered 1 to " + n + ", those of " +
                                Join(others->second, ", ", name) + " 0 to " + last;
      const bool sure = counted || ListsEveryFrame(*track);
      const std::optional<int> first = sure ? 1 : FirstByMotion(changes, with, *tracks, track->camera);
      if (first == 0) continue;
      if (first == 1) ones.push_back(track);
      notes->warnings.push_back(
          first ? Notice{"POSE-FIRST", begin + ": frame 1 of the former was taken for frame 0, since its program counts from 1",
                         "if the numbers are right as they are, option 'first-frame' 0 says so"}
                : Notice{"POSE-FIRST",
                         begin + ": the former's program may count from 1, or each may have missed one end of the take; the "
                                 "numbers were taken as they are",
                         "if its program counts from 1, option 'first-frame' " + track->camera + "=1 says so, else 0"});
    }
  }
  for (Pose2dTrack* track : ones) CountFrom(1, track);
}

}  // namespace

void CountFrom(int first, Pose2dTrack* track) {
  if (!track->frames.empty() && track->frames.begin()->first < first)
    throw FormatError("camera " + track->camera, "frame " + std::to_string(track->frames.begin()->first),
                      "is before option 'first-frame' " + std::to_string(first) + ", the number of the first frame");
  dataset::NumberFrom(first, &track->frames);
}

void NumberFromZero(const PoseChanges& changes, const std::vector<NamedPath>& footage, std::vector<Pose2dTrack>* tracks,
                    InputNotes* notes, const NumberingRig& with) {
  if (!changes.first_frame.empty()) {
    for (Pose2dTrack& track : *tracks) CountFrom(FirstFrameOf(changes, track.camera), &track);
    return;
  }
  const std::set<std::string> known = NumberAsFootage(footage, tracks, notes);
  NumberAsOthers(changes, known, with, tracks, notes);
}

void ReportFirstNumber(FirstNumber first, const std::string& whose, InputNotes* notes) {
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
