#include "avatar/run/render/render_pose.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "avatar/maps/bone_lists.h"
#include "core/check.h"
#include "core/choice/frame_choice.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/join.h"
#include "core/statistics.h"
#include "dataset/views/crop.h"

namespace mvstudio::avatar {
namespace {

namespace fs = std::filesystem;
using dataset::Coco19Pose;

constexpr int kRoot = 2;           // BodyCenter
constexpr double kMaxStretch = 3;  // a bone so many times too long ends in a joint that was found wrongly
constexpr int kAnkles[] = {8, 14};

/// Bones from the root outwards.
struct TreeBone {
  size_t bone;
  int parent, child;
};

std::vector<TreeBone> Tree() {
  std::vector<TreeBone> tree;
  std::array<bool, 19> placed{};
  placed[kRoot] = true;
  while (tree.size() < kBones.size()) {
    for (size_t b = 0; b < kBones.size(); ++b) {
      auto [a, c] = kBones[b];
      if (placed[a] == placed[c]) continue;
      if (placed[c]) std::swap(a, c);
      tree.push_back({b, a, c});
      placed[c] = true;
    }
  }
  return tree;
}

int MostFrequentPerson(const std::map<int, std::map<int, Coco19Pose>>& frames, int requested, const std::string& path) {
  std::map<int, int> count;
  for (const auto& [frame, people] : frames) {
    for (const auto& [id, pose] : people) ++count[id];
  }
  if (count.empty()) throw FormatError(path, "", "no frame has a person in it");
  if (requested >= 0 && !count.count(requested)) {
    throw UsageError("person " + std::to_string(requested) + " is not in " + path + "; it has " +
                     Join(count, ", ", [](const auto& person) { return std::to_string(person.first); }));
  }
  if (requested >= 0) return requested;
  const auto fewer = [](const auto& a, const auto& b) { return a.second < b.second; };
  return std::max_element(count.begin(), count.end(), fewer)->first;
}

PoseTrack OnePerson(const std::map<int, std::map<int, Coco19Pose>>& frames, int person, const std::string& path) {
  PoseTrack track;
  track.source = path;
  person = MostFrequentPerson(frames, person, path);
  for (const auto& [frame, people] : frames) {
    const auto found = people.find(person);
    if (found == people.end()) continue;
    track.frames.push_back(frame);
    track.poses.push_back(found->second);
  }
  return track;
}

/// From the universal clock of the first and the last file; 0 where the writer did not know it.
double RateOf(const std::map<int, std::string>& scenes) {
  if (scenes.size() < 2) return 0;
  const double first_ms = dataset::ReadBody3dSceneFile(scenes.begin()->second).univ_time_ms;
  const double last_ms = dataset::ReadBody3dSceneFile(scenes.rbegin()->second).univ_time_ms;
  if (first_ms < 0 || !(last_ms > first_ms)) return 0;
  return 1000.0 * (scenes.rbegin()->first - scenes.begin()->first) / (last_ms - first_ms);
}

int FrameInName(const std::string& file) {
  const std::string stem = fs::path(file).stem().string();
  const std::string digits = stem.substr(stem.find_last_not_of("0123456789") + 1);
  if (digits.empty() || digits.size() > 9) throw FormatError(file, "", "the file name does not end in a frame number");
  return std::stoi(digits);
}

/// body3DScene files of a sequence's root, of the folder itself, or the one file.
std::map<int, std::string> ScenesAt(const std::string& path) {
  std::map<int, std::string> scenes;
  if (!fs::is_directory(path)) {
    const std::string extension = fs::path(path).extension().string();
    if (extension != ".json") {
      throw FormatError(
          path, "",
          std::string("is of a kind that is not read as poses") +
              (extension == ".npz" ? " (AMASS, AIST++: parameters of SMPL, no joints)" : "") +
              "; known are body3DScene_*.json, a folder of them, a Panoptic sequence, a pose3d folder, and BVH with "
              "option 'bvh'");
    }
    return {{FrameInName(path), path}};
  }
  for (const std::string& file : FilesNamed(path, "body3DScene_", ".json")) scenes[FrameInName(file)] = file;
  return scenes.empty() ? dataset::ListBody3dScenes(path) : scenes;
}

}  // namespace

PoseTrack TrackOf(const dataset::PanopticDataset& data, int person) {
  PoseTrack track = OnePerson(data.poses, person, data.root);
  track.rate_hz = RateOf(dataset::ListBody3dScenes(data.root));
  return track;
}

PoseTrack ReadPoseTrack(const std::string& path, int person) {
  if (!fs::exists(path))
    throw IoError(path, "no such file or folder; give a Panoptic sequence, body3DScene files or a pose3d folder");
  if (fs::exists(fs::path(path) / "points.csv")) return OnePerson(dataset::ToCoco19(dataset::ReadPose3d(path)), person, path);
  const std::map<int, std::string> scenes = ScenesAt(path);
  if (scenes.empty()) {
    throw IoError(path, "holds neither body3DScene_*.json nor points.csv; give a Panoptic sequence or a pose3d folder");
  }
  std::map<int, std::map<int, Coco19Pose>> frames;
  for (const auto& [frame, file] : scenes) frames[frame] = dataset::ReadBody3dScene(file);
  PoseTrack track = OnePerson(frames, person, path);
  track.rate_hz = RateOf(scenes);
  return track;
}

PoseTrack SelectFrames(const PoseTrack& track, const std::vector<int>& frames, int step) {
  if (step < 1) throw UsageError("option 'every' must be at least 1");
  const FrameChoice choice = KnownFrames("option 'frames'", frames, track.frames, track.source);
  const std::vector<int>& wanted = frames.empty() ? track.frames : choice.frames;
  PoseTrack some{track.source, {}, {}, track.rate_hz, choice.beyond};
  for (size_t i = 0; i < wanted.size(); i += static_cast<size_t>(step)) {
    const auto found = std::lower_bound(track.frames.begin(), track.frames.end(), wanted[i]);
    some.frames.push_back(wanted[i]);
    some.poses.push_back(track.poses[found - track.frames.begin()]);
  }
  return some;
}

SkeletonSize MeasureSkeleton(const std::vector<Coco19Pose>& poses) {
  std::array<std::vector<double>, 18> lengths;
  std::vector<double> x, y, ankle_z;
  for (const Coco19Pose& pose : poses) {
    for (size_t b = 0; b < kBones.size(); ++b) {
      const auto [a, c] = kBones[b];
      const double length = (pose.x_in_world.col(a) - pose.x_in_world.col(c)).norm();
      if (pose.valid[a] && pose.valid[c] && std::isfinite(length)) lengths[b].push_back(length);
    }
    if (pose.valid[kRoot]) x.push_back(pose.x_in_world(0, kRoot)), y.push_back(pose.x_in_world(1, kRoot));
    for (const int ankle : kAnkles) {
      if (pose.valid[ankle]) ankle_z.push_back(pose.x_in_world(2, ankle));
    }
  }
  SkeletonSize size;
  for (size_t b = 0; b < lengths.size(); ++b) {
    size.length_m[b] = NearestQuantile(lengths[b], 0.5);
    size.short_m[b] = NearestQuantile(lengths[b], 0.05), size.long_m[b] = NearestQuantile(lengths[b], 0.95);
  }
  const auto or_zero = [](double value) { return std::isfinite(value) ? value : 0; };
  size.ground = {or_zero(NearestQuantile(x, 0.5)), or_zero(NearestQuantile(y, 0.5)), or_zero(NearestQuantile(ankle_z, 0.02))};
  return size;
}

double SizeRatio(const SkeletonSize& trained, const SkeletonSize& other, const std::string& source) {
  constexpr size_t kLimbs[] = {7, 8, 10, 11, 13, 14, 16, 17};
  std::vector<size_t> shared, limbs;
  for (size_t b = 0; b < kBones.size(); ++b) {
    if (!std::isfinite(trained.length_m[b]) || !std::isfinite(other.length_m[b])) continue;
    shared.push_back(b);
    if (std::find(std::begin(kLimbs), std::end(kLimbs), b) != std::end(kLimbs)) limbs.push_back(b);
  }
  double sum_trained = 0, sum_other = 0;
  for (const size_t b : limbs.empty() ? shared : limbs) sum_trained += trained.length_m[b], sum_other += other.length_m[b];
  if (!(sum_trained > 0 && sum_other > 0)) throw FormatError(source, "", "no pose shows a bone that the training set shows");
  return sum_trained / sum_other;
}

Coco19Pose NormaliseScale(const Coco19Pose& pose, const SkeletonSize& trained, double ratio) {
  static const std::vector<TreeBone> tree = Tree();
  MVS_CHECK(ratio > 0 && std::isfinite(ratio), "ratio " << ratio);
  Coco19Pose scaled = pose;
  scaled.x_in_world = ratio * pose.x_in_world;
  std::array<int, 19> anchor;  // the joint itself, or the nearest ancestor that is there; -1: none
  anchor.fill(-1);
  scaled.valid[kRoot] = pose.valid[kRoot] && pose.x_in_world.col(kRoot).allFinite();
  if (scaled.valid[kRoot]) anchor[kRoot] = kRoot;
  for (const TreeBone& b : tree) {
    const int from = anchor[b.parent];
    anchor[b.child] = pose.valid[b.child] ? b.child : from;
    if (!pose.valid[b.child] || from < 0) continue;
    const Eigen::Vector3d step = pose.x_in_world.col(b.child) - pose.x_in_world.col(from);
    const double length = step.norm(), wanted = trained.length_m[b.bone];
    const bool known = from == b.parent && length > 0 && std::isfinite(wanted);
    if (!std::isfinite(length) || (known && ratio * length > kMaxStretch * wanted)) {
      scaled.valid[b.child] = false, anchor[b.child] = from;
      continue;
    }
    const double clamped = std::clamp(ratio * length, trained.short_m[b.bone], trained.long_m[b.bone]);
    scaled.x_in_world.col(b.child) = scaled.x_in_world.col(from) + step * (known ? clamped / length : ratio);
  }
  return scaled;
}

void Shift(PoseTrack* track, const Eigen::Vector3d& by_m) {
  for (Coco19Pose& pose : track->poses) pose.x_in_world.colwise() += by_m;
}

}  // namespace mvstudio::avatar
