#include "avatar/run/pretrain/motion_clips.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "avatar/body/body_template.h"
#include "avatar/run/render/bvh_pose.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/views/crop.h"

namespace mvstudio::avatar {
namespace {

using dataset::Coco19Pose;

constexpr int kBlock = 16, kEvery = 5, kHeldOut = 2;  // the third block of every five

/// Whether a template posed by these joints is determined: head, eyes and ears may be missing.
bool ShowsTheBody(const Coco19Pose& pose) {
  const std::array<bool, 19> plausible = dataset::PlausibleJoints(pose);
  for (int j = 0; j < 15; ++j) {
    if (j != 1 && !plausible[j]) return false;
  }
  return true;
}

void Add(int frame, const Coco19Pose& pose, MotionClip* clip) {
  if (!ShowsTheBody(pose)) return;
  clip->frames.push_back(frame);
  clip->poses.push_back(pose);
}

Coco19Pose AdultAtRest() {
  Coco19Pose pose;
  pose.x_in_world = body::MakeMannequin(1.75, 0.5).coco19;
  pose.valid.fill(true), pose.confidence.fill(1);
  return pose;
}

std::map<int, std::string> ScenesOf(const std::string& root, const std::vector<int>& frames) {
  RequireFolder(root, "; give a dataset in Panoptic's layout");
  const std::map<int, std::string> all = dataset::ListBody3dScenes(root);
  if (all.empty()) throw IoError(root + "/hdPose3d_stage1_coco19", "holds no body3DScene_%08d.json");
  if (frames.empty()) return all;
  std::map<int, std::string> some;
  for (const int frame : frames) {
    const auto found = all.find(frame);
    if (found == all.end())
      throw UsageError("frame " + std::to_string(frame) + " is not in " + root + "; its frames are " +
                       std::to_string(all.begin()->first) + " to " + std::to_string(all.rbegin()->first));
    some.insert(*found);
  }
  return some;
}

}  // namespace

MotionClip ClipOfBvh(const std::string& path) {
  const PoseTrack track = PosesFromBvh(ReadBvh(path), MeasureHead({}), path);
  const SkeletonSize adult = MeasureSkeleton({AdultAtRest()});
  const double ratio = SizeRatio(adult, MeasureSkeleton(track.poses), path);
  MotionClip clip;
  clip.source = path;
  for (size_t i = 0; i < track.poses.size(); ++i) Add(track.frames[i], NormaliseScale(track.poses[i], adult, ratio), &clip);
  if (clip.poses.empty()) throw FormatError(path, "MOTION", "no frame shows neck, hips, arms and legs");
  return clip;
}

std::vector<MotionClip> ClipsOfDataset(const std::string& root, const std::vector<int>& frames) {
  std::map<int, MotionClip> people;
  for (const auto& [frame, file] : ScenesOf(root, frames)) {
    for (const auto& [person, pose] : dataset::ReadBody3dScene(file)) Add(frame, pose, &people[person]);
  }
  std::vector<MotionClip> clips;
  for (auto& [person, clip] : people) {
    if (clip.poses.empty()) continue;
    clip.source = root, clip.person = person;
    clips.push_back(std::move(clip));
  }
  if (clips.empty())
    throw FormatError(root, "hdPose3d_stage1_coco19",
                      "no frame shows a person's neck, hips, arms and legs: nothing to learn from");
  return clips;
}

void HoldOutBlocks(MotionClip* clip) {
  clip->learned.clear(), clip->held_out.clear();
  const int count = static_cast<int>(clip->poses.size()), block = std::clamp(count / kEvery, 1, kBlock);
  for (int i = 0; i < count; ++i) {
    const bool out = count >= kEvery && (i / block) % kEvery == kHeldOut;
    (out ? clip->held_out : clip->learned).push_back(i);
  }
}

}  // namespace mvstudio::avatar
