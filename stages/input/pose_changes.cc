#include "stages/input/pose_changes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "core/choice/frame_choice.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/text/shell_word.h"
#include "stages/frame_notice.h"
#include "stages/input/calib_read.h"
#include "stages/input/take_frames.h"
#include "stages/words.h"
#include "triangulate/sync/sync.h"

namespace mvstudio::stages {
namespace {

using dataset::Keypoint2d;
using dataset::Person2d;
using dataset::Pose2dTrack;

std::vector<std::string> Words(const std::string& text, char between) {
  std::vector<std::string> words;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(between, begin), text.size());
    words.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return words;
}

double NumberOf(const std::string& option, const CameraValue& value) {
  size_t read = 0;
  double number = std::nan("");
  try {
    number = std::stod(value.value, &read);
  } catch (const std::exception&) {  // no number, or beyond what a number holds
  }
  if (read == 0 || read != value.value.size() || !std::isfinite(number))
    throw UsageError("option '" + option + "' " + ToString(value) + ": " + value.value + " is not a number");
  return number;
}

/// The value of a camera: its own, else that of all.
const CameraValue* ValueOf(const std::vector<CameraValue>& values, const std::string& camera) {
  const CameraValue* found = nullptr;
  for (const CameraValue& value : values) {
    if (value.camera == camera || (value.camera.empty() && !found)) found = &value;
  }
  return found;
}

void CheckKnown(const std::string& option, const std::string& camera, const std::vector<Pose2dTrack>& tracks) {
  for (const Pose2dTrack& track : tracks) {
    if (track.camera == camera) return;
  }
  throw UsageError("option '" + option + "' names camera " + camera + ", which has no 2D joints; there are " +
                   Join(tracks, ", ", &Pose2dTrack::camera));
}

void CheckNames(const PoseChanges& changes, const std::vector<Pose2dTrack>& tracks) {
  const std::pair<const char*, const CameraSet*> sets[] = {{"normalized", &changes.normalized},
                                                           {"flip-y", &changes.flip_y},
                                                           {"flip-x", &changes.flip_x},
                                                           {"swap-sides", &changes.swap_sides}};
  for (const auto& [option, set] : sets) {
    for (const std::string& name : set->names) CheckKnown(option, name, tracks);
  }
  const std::pair<const char*, const std::vector<CameraValue>*> values[] = {{"rotate", &changes.rotate},
                                                                            {"image-size", &changes.image_size},
                                                                            {"rate", &changes.rate},
                                                                            {"first-frame", &changes.first_frame}};
  for (const auto& [option, list] : values) {
    std::set<std::string> seen;
    for (const CameraValue& value : *list) {
      if (!value.camera.empty()) CheckKnown(option, value.camera, tracks);
      if (!seen.insert(value.camera).second)
        throw UsageError(std::string("option '") + option + "' is given twice for " +
                         (value.camera.empty() ? "all cameras" : "camera " + value.camera));
    }
  }
  for (const std::string& name : changes.without_cameras) CheckKnown("without-camera", name, tracks);
}

void SwapCameras(const std::vector<std::string>& pairs, std::vector<Pose2dTrack>* tracks) {
  for (const std::string& pair : pairs) {
    const std::vector<std::string> names = Words(pair, ',');
    if (names.size() != 2 || names[0] == names[1])
      throw UsageError("option 'swap-cameras' " + pair + ": give two cameras, A,B");
    for (const std::string& name : names) CheckKnown("swap-cameras", name, *tracks);
    for (Pose2dTrack& track : *tracks) {
      if (track.camera == names[0]) {
        track.camera = names[1];
      } else if (track.camera == names[1]) {
        track.camera = names[0];
      }
    }
  }
}

int TurnOf(const PoseChanges& changes, const std::string& camera) {
  const CameraValue* turn = ValueOf(changes.rotate, camera);
  if (!turn) return 0;
  const double degrees = NumberOf("rotate", *turn);
  for (const int known : {0, 90, 180, 270}) {
    if (degrees == known || degrees == known - 360) return known;
  }
  throw UsageError("option 'rotate' " + ToString(*turn) + ": must be 90, 180 or 270, degrees clockwise");
}

/// How one camera's pixels become those of its calibrated image.
struct PixelChange {
  bool normalized = false, flip_x = false, flip_y = false;
  triangulate::ShareRange shares = {};
  int turn = 0;
  double width = 0, height = 0;                        // of the images that the joints were found in
  double calibrated_width = 0, calibrated_height = 0;  // px

  void Apply(Keypoint2d* key) const {
    double x = key->x_px, y = key->y_px;
    if (normalized) x = shares.Share(x) * width, y = shares.Share(y) * height;
    if (flip_y) y = height - y;
    if (flip_x) x = width - 1 - x;
    double upright_width = width, upright_height = height;
    if (turn == 90 || turn == 270) std::swap(upright_width, upright_height);
    const double x_rotated = x;
    if (turn == 90) x = y, y = upright_height - 1 - x_rotated;
    if (turn == 180) x = width - 1 - x, y = height - 1 - y;
    if (turn == 270) x = upright_width - 1 - y, y = x_rotated;
    key->x_px = upright_width == calibrated_width ? x : (x + 0.5) * calibrated_width / upright_width - 0.5;
    key->y_px = upright_height == calibrated_height ? y : (y + 0.5) * calibrated_height / upright_height - 0.5;
  }
  bool IsNeeded() const {
    const bool rotated = turn == 90 || turn == 270;
    return normalized || flip_x || flip_y || turn != 0 || (rotated ? height : width) != calibrated_width ||
           (rotated ? width : height) != calibrated_height;
  }
};

PixelChange PixelChangeOf(const PoseChanges& changes, const geometry::Camera& camera) {
  PixelChange change;
  change.normalized = changes.normalized.Has(camera.name);
  change.flip_x = changes.flip_x.Has(camera.name), change.flip_y = changes.flip_y.Has(camera.name);
  change.turn = TurnOf(changes, camera.name);
  change.calibrated_width = change.width = camera.width_px, change.calibrated_height = change.height = camera.height_px;
  if (change.turn == 90 || change.turn == 270) std::swap(change.width, change.height);
  if (const CameraValue* size = ValueOf(changes.image_size, camera.name)) {
    ImageSize found;
    FromString(size->value, &found);
    change.width = found.width_px, change.height = found.height_px;
  }
  return change;
}

void SwapSides(const geometry::Skeleton& skeleton, Pose2dTrack* track) {
  for (auto& [frame, people] : track->frames) {
    for (Person2d& person : people) {
      for (const auto& group : geometry::MirrorGroups(skeleton)) {
        for (const auto& [left, right] : group)
          std::swap(person.keypoints.at(static_cast<size_t>(left)), person.keypoints.at(static_cast<size_t>(right)));
      }
    }
  }
}

template <class Change>
void ForEachKeypoint(Pose2dTrack* track, const Change& change) {
  for (auto& [frame, people] : track->frames) {
    for (Person2d& person : people) {
      for (Keypoint2d& key : person.keypoints) change(&key);
    }
  }
}

/// Frames of each camera for one time step.
std::map<std::string, double> RatiosOf(const std::vector<CameraValue>& rates, const std::vector<Pose2dTrack>& tracks) {
  std::map<std::string, double> ratios;
  double lowest = INFINITY, common = 0;
  for (const CameraValue& rate : rates) {
    const double hz = NumberOf("rate", rate);
    if (!(hz > 0)) throw UsageError("option 'rate' " + ToString(rate) + ": must be above 0, frames a second");
    if (rate.camera.empty()) common = hz;
    lowest = std::min(lowest, hz);
  }
  for (const Pose2dTrack& track : tracks) {
    const CameraValue* rate = ValueOf(rates, track.camera);
    if (!rate) {
      throw UsageError("option 'rate' says nothing of camera " + track.camera +
                       ": give all cameras' rate too, e.g. option 'rate' 60");
    }
    ratios[track.camera] = NumberOf("rate", *rate) / (common > 0 ? common : lowest);
    if (!(ratios[track.camera] >= 1e-3 && ratios[track.camera] <= 1e3))
      throw UsageError("option 'rate' " + ToString(*rate) + ": rates may differ by a factor of 1000 at most");
  }
  return ratios;
}

void ChangeRate(double ratio, Pose2dTrack* track) {
  if (ratio == 1) return;
  geometry::Rig alone;
  alone.cameras.emplace_back().camera.name = track->camera;
  const auto timed = triangulate::ApplyClocks(ToFrames({*track}, alone, ""), {{0, ratio}});
  track->frames.clear();
  for (const triangulate::DetectedFrame& frame : timed) {
    std::vector<Person2d>& people = track->frames[frame.frame];
    for (const triangulate::DetectedPerson& detected : frame.people[0]) {
      Person2d& person = people.emplace_back();
      for (const triangulate::Keypoint& key : detected) person.keypoints.push_back({key.px.x(), key.px.y(), key.score});
    }
  }
}

/// Of the joints that both tracks show, how many are at one pixel.
struct Alike {
  int64_t compared = 0, equal = 0;
};

Alike Compare(const Pose2dTrack& a, const Pose2dTrack& b) {
  constexpr double kOne = 1e-6;  // px
  Alike alike;
  for (const auto& [frame, people] : a.frames) {
    const auto other = b.frames.find(frame);
    if (other == b.frames.end()) continue;
    for (size_t p = 0; p < std::min(people.size(), other->second.size()); ++p) {
      const auto &of_a = people[p].keypoints, &of_b = other->second[p].keypoints;
      for (size_t j = 0; j < std::min(of_a.size(), of_b.size()); ++j) {
        if (!(of_a[j].score > 0) || !(of_b[j].score > 0)) continue;
        ++alike.compared;
        alike.equal += std::abs(of_a[j].x_px - of_b[j].x_px) < kOne && std::abs(of_a[j].y_px - of_b[j].y_px) < kOne;
      }
    }
    if (alike.compared >= 100 && 2 * alike.equal < alike.compared) break;  // two cameras
  }
  return alike;
}

}  // namespace

bool CameraSet::Has(const std::string& camera) const {
  return all || std::find(names.begin(), names.end(), camera) != names.end();
}

std::string ToString(const CameraSet& cameras) { return cameras.all ? "all" : Join(cameras.names, ","); }

void FromString(const std::string& text, const std::string& option, CameraSet* cameras) {
  cameras->all = text.empty();
  cameras->names = text.empty() ? std::vector<std::string>() : Words(text, ',');
  for (const std::string& name : cameras->names) {
    if (name.empty()) throw UsageError("option '" + option + "' " + text + ": give names of cameras with commas between");
  }
}

std::string ToString(const CameraValue& value) { return value.camera.empty() ? value.value : value.camera + "=" + value.value; }

void FromString(const std::string& text, const std::string& option, CameraValue* value) {
  const size_t equal = text.rfind('=');
  value->camera = equal == std::string::npos ? "" : text.substr(0, equal);
  value->value = equal == std::string::npos ? text : text.substr(equal + 1);
  if (value->value.empty() || equal == 0) throw UsageError("option '" + option + "' " + text + ": give VALUE or CAMERA=VALUE");
}

triangulate::ShareRange SharesOf(const Pose2dTrack& track) {
  triangulate::Coordinates all;
  for (const auto& [frame, people] : track.frames) {
    for (const Person2d& person : people) {
      for (const Keypoint2d& key : person.keypoints) {
        if (!(key.score > 0) || !std::isfinite(key.x_px + key.y_px)) continue;
        all.Add(key.x_px), all.Add(key.y_px);
      }
    }
  }
  return all.Range();
}

void ApplyChanges(const PoseChanges& changes, const geometry::Rig& rig, const geometry::Skeleton& skeleton,
                  std::vector<Pose2dTrack>* tracks) {
  SwapCameras(changes.swap_cameras, tracks);
  CheckNames(changes, *tracks);
  const auto is_left_out = [&](const Pose2dTrack& track) {
    return std::find(changes.without_cameras.begin(), changes.without_cameras.end(), track.camera) !=
           changes.without_cameras.end();
  };
  tracks->erase(std::remove_if(tracks->begin(), tracks->end(), is_left_out), tracks->end());
  for (Pose2dTrack& track : *tracks) {
    const int camera = rig.Find(track.camera);
    if (camera < 0) continue;  // named as unknown later
    if (changes.ignore_scores) {
      ForEachKeypoint(&track, [](Keypoint2d* key) {
        const bool seen = std::isfinite(key->x_px) && std::isfinite(key->y_px) && (key->x_px != 0 || key->y_px != 0);
        key->score = seen ? 1 : 0;
      });
    }
    PixelChange change = PixelChangeOf(changes, rig.cameras[static_cast<size_t>(camera)].camera);
    change.normalized |= std::exchange(track.normalized, false);
    if (change.normalized)
      change.shares = changes.shares.count(track.camera) ? changes.shares.at(track.camera) : SharesOf(track);
    if (change.IsNeeded()) ForEachKeypoint(&track, [&](Keypoint2d* key) { change.Apply(key); });
    if (changes.swap_sides.Has(track.camera)) SwapSides(skeleton, &track);
  }
  if (changes.rate.empty()) return;
  const std::map<std::string, double> ratios = RatiosOf(changes.rate, *tracks);
  for (Pose2dTrack& track : *tracks) ChangeRate(ratios.at(track.camera), &track);
}

void RefuseEqual(const std::vector<Pose2dTrack>& tracks, const geometry::Rig& rig, const std::vector<NamedPath>& pose2d,
                 const std::string& points2d) {
  constexpr int64_t kFewest = 20;
  constexpr double kAll = 0.95;
  const std::vector<int> duplicate_of = triangulate::Prepare(rig).duplicate_of;
  const auto camera_of = [&](const Pose2dTrack& track) {  // cameras with one lens and place count as one
    const int camera = rig.Find(track.camera);
    const int original = camera < 0 ? -1 : duplicate_of[static_cast<size_t>(camera)];
    return original < 0 ? camera : original;
  };
  for (size_t b = 0; b < tracks.size(); ++b) {
    for (size_t a = 0; a < b; ++a) {
      if (camera_of(tracks[a]) < 0 || camera_of(tracks[a]) == camera_of(tracks[b])) continue;
      const Alike alike = Compare(tracks[a], tracks[b]);
      if (alike.compared < kFewest || static_cast<double>(alike.equal) < kAll * static_cast<double>(alike.compared)) continue;
      std::string path = points2d;
      for (const NamedPath& named : pose2d) {
        if (named.name == tracks[b].camera) path = named.path;
      }
      throw FormatError(path, "cameras " + tracks[a].camera + " and " + tracks[b].camera,
                        Format("%lld of %lld joints that both show are at the same pixels, as two cameras never see them: one "
                               "recording was given for both; give ",
                               static_cast<long long>(alike.equal), static_cast<long long>(alike.compared)) +
                            tracks[b].camera + " its own, or leave it out (option 'without-camera' " +
                            ShellWord(tracks[b].camera) + ")");
    }
  }
}

std::vector<int> LimitFrames(const PoseChanges& changes, const std::vector<int>& there, InputNotes* notes) {
  if (changes.frames.empty()) return there;
  FrameChoice choice =
      KnownFrames("option 'frames'", ParseRanges("option 'frames'", changes.frames), there, "the 2D poses of all cameras");
  NoteFrames(choice.beyond, notes);
  return std::move(choice.frames);
}

void LimitFrames(const PoseChanges& changes, std::vector<Pose2dTrack>* tracks, InputNotes* notes) {
  if (changes.frames.empty()) return;
  std::vector<int> there;
  for (const Pose2dTrack& track : *tracks) {
    for (const auto& [frame, people] : track.frames) there.push_back(frame);
  }
  const std::vector<int> kept = LimitFrames(changes, there, notes);
  for (Pose2dTrack& track : *tracks) {
    for (auto it = track.frames.begin(); it != track.frames.end();)
      it = std::binary_search(kept.begin(), kept.end(), it->first) ? std::next(it) : track.frames.erase(it);
  }
}

int FirstFrameOf(const PoseChanges& changes, const std::string& camera) {
  const CameraValue* first = ValueOf(changes.first_frame, camera);
  if (!first) return 0;
  const double number = NumberOf("first-frame", *first);
  if (number != std::floor(number) || std::abs(number) > 999999999)
    throw UsageError("option 'first-frame' " + ToString(*first) + ": must be a whole number, as 0 or 1");
  return static_cast<int>(number);
}

double StepRateHz(const PoseChanges& changes) {
  double lowest_hz = 0;
  for (const CameraValue& value : changes.rate) {
    const double hz = NumberOf("rate", value);
    if (value.camera.empty()) return hz;
    lowest_hz = lowest_hz > 0 ? std::min(lowest_hz, hz) : hz;
  }
  return lowest_hz;
}

}  // namespace mvstudio::stages
