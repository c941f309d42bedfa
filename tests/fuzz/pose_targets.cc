#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "core/disk/output.h"
#include "dataset/pose/pose2d.h"
#include "dataset/pose/pose3d.h"
#include "dataset/pose/pose3d_trc.h"
#include "dataset/time/sync_file.h"
#include "tests/fuzz/fuzz.h"

/// 2D and 3D joints and time offsets. What is read must be writable and read back the same.
namespace mvstudio::fuzz {
namespace {

using dataset::Keypoint2d;
using dataset::Pose2dSet;
using dataset::Pose2dTrack;

bool Same(const Keypoint2d& a, const Keypoint2d& b) { return a.x_px == b.x_px && a.y_px == b.y_px && a.score == b.score; }

void RequireSound(const Pose2dTrack& track, size_t num_joints) {
  for (const auto& [frame, people] : track.frames) {
    Require(frame >= 0, "a negative frame");
    for (const dataset::Person2d& person : people) {
      Require(person.keypoints.size() == num_joints, "a person of another number of joints than the skeleton");
      for (const Keypoint2d& key : person.keypoints) {
        Require(std::isfinite(key.x_px) && std::isfinite(key.y_px) && std::isfinite(key.score), "a joint that is not finite");
      }
    }
  }
}

void RequireSame(const Pose2dTrack& a, const Pose2dTrack& b) {
  Require(a.frames.size() == b.frames.size(), "the number of frames changed");
  for (const auto& [frame, people] : a.frames) {
    const auto found = b.frames.find(frame);
    Require(found != b.frames.end() && found->second.size() == people.size(), "the people of a frame changed");
    for (size_t p = 0; p < people.size(); ++p) {
      const auto &keys = people[p].keypoints, &others = found->second[p].keypoints;
      for (size_t k = 0; k < keys.size(); ++k) Require(Same(keys[k], others[k]), "a joint changed");
    }
  }
}

void RequireFolderRoundTrip(const Pose2dTrack& track, const geometry::Skeleton& skeleton) {
  const mvstudio::ScratchFolder work(ScratchFolder("openpose-out"));  // as in commands: outside, each file is listed at once
  const std::string folder = work.path() + "/cam";
  dataset::WriteOpenPoseFolder(track, folder, &skeleton);
  RequireSame(track, dataset::ReadOpenPoseFolder(folder, "cam", skeleton));
}

void RunOpenPose(std::string_view bytes, const char* skeleton_name) {
  const geometry::Skeleton& skeleton = geometry::SkeletonByName(skeleton_name);
  const std::string folder = ScratchFolder("openpose");
  Scratch("openpose/cam_000000000007_keypoints.json", bytes);
  Pose2dTrack track;
  if (!Accepts([&] { track = dataset::ReadOpenPoseFolder(folder, "cam", skeleton); })) return;
  RequireSound(track, skeleton.joints.size());
  RequireFolderRoundTrip(track, skeleton);
}

/// People without any score are not written; what is left is numbered anew.
void DropUnseen(Pose2dSet* set) {
  for (Pose2dTrack& track : set->tracks) {
    for (auto frame = track.frames.begin(); frame != track.frames.end();) {
      auto& people = frame->second;
      for (size_t p = 0; p < people.size();) {
        auto& keys = people[p].keypoints;
        bool seen = false;
        for (Keypoint2d& key : keys) {
          if (key.score == 0) key = Keypoint2d();
          seen |= key.score != 0;
        }
        if (seen) {
          ++p;
        } else {
          people.erase(people.begin() + static_cast<std::ptrdiff_t>(p));
        }
      }
      frame = people.empty() ? track.frames.erase(frame) : std::next(frame);
    }
  }
}

}  // namespace

MVS_FUZZ_TARGET(openpose_json, bytes) { RunOpenPose(bytes, "body25"); }

MVS_FUZZ_TARGET(openpose_parts_json, bytes) { RunOpenPose(bytes, "body25+hands"); }

MVS_FUZZ_TARGET(pose_results_json, bytes) {
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("coco17");
  const std::string path = InMemory("results.json", bytes);
  Pose2dTrack track;
  if (!Accepts([&] { track = dataset::ReadPoseResults(path, "cam", skeleton); })) return;
  RequireSound(track, skeleton.joints.size());
  if (!track.frames.empty()) RequireFolderRoundTrip(track, skeleton);
}

MVS_FUZZ_TARGET(pose2d_csv, bytes) {
  Pose2dSet set;
  const std::string path = InMemory("points2d.csv", bytes);
  if (!Accepts([&] { set = dataset::ReadPose2dCsv(path); })) return;
  for (const Pose2dTrack& track : set.tracks) RequireSound(track, set.skeleton.joints.size());
  DropUnseen(&set);
  bool any = false;
  for (const Pose2dTrack& track : set.tracks) any |= !track.frames.empty();
  if (!any) return;
  const std::string out = MemoryPath("points2d-out.csv");
  dataset::WritePose2dCsv(set, out);
  Pose2dSet back = dataset::ReadPose2dCsv(out, &set.skeleton);
  Require(back.skipped.empty(), "what was written is not all read");
  std::map<std::string, const Pose2dTrack*> by_camera;
  for (const Pose2dTrack& track : back.tracks) by_camera[track.camera] = &track;
  for (const Pose2dTrack& track : set.tracks) {
    if (track.frames.empty()) continue;
    const auto found = by_camera.find(track.camera);
    Require(found != by_camera.end(), "a camera is gone");
    RequireSame(track, *found->second);
  }
}

MVS_FUZZ_TARGET(pose3d, bytes) {
  const auto parts = Parts(bytes, 3);
  const std::string folder = ScratchFolder("pose3d");
  Scratch("pose3d/points.csv", parts[0]);
  Scratch("pose3d/covariance.csv", parts[1]);
  Scratch("pose3d/pose3d.json", parts[2]);
  dataset::Pose3d pose;
  if (!Accepts([&] { pose = dataset::ReadPose3d(folder); })) return;
  Accepts([&] { dataset::ToCoco19(pose); });
  const std::string out = ScratchFolder("pose3d-out");
  dataset::WritePose3d(pose, out);
  const dataset::Pose3d back = dataset::ReadPose3d(out);
  Require(back.skeleton == pose.skeleton && back.rows.size() == pose.rows.size(), "rows or skeleton changed");
  for (size_t i = 0; i < pose.rows.size(); ++i) {
    const dataset::JointRow &a = pose.rows[i], &b = back.rows[i];
    Require(a.frame == b.frame && a.person == b.person && a.joint == b.joint && a.status == b.status, "a row changed");
    Require(a.x_in_world == b.x_in_world && a.num_views == b.num_views && a.rms_px == b.rms_px && a.sigma_m == b.sigma_m,
            "the numbers of a row changed");
    Require(a.covariance.has_value() == b.covariance.has_value(), "a covariance is gone");
    if (a.covariance) Require(*a.covariance == *b.covariance, "a covariance changed");
  }
}

MVS_FUZZ_TARGET(trc, bytes) {
  dataset::Pose3d pose;
  const std::string path = InMemory("in.trc", bytes);
  if (!Accepts([&] { pose = dataset::ReadTrc(path); })) return;
  for (const dataset::JointRow& row : pose.rows) {
    Require(row.status != Status::kOk || row.x_in_world.allFinite(), "a joint that is Ok and not finite");
  }
}

MVS_FUZZ_TARGET(sync_json, bytes) {
  dataset::SyncFile sync;
  const std::string path = InMemory("sync.json", bytes);
  if (!Accepts([&] { sync = dataset::ReadSync(path); })) return;
  const std::string out = MemoryPath("sync-out.json");
  dataset::WriteSync(sync, out);
  const dataset::SyncFile back = dataset::ReadSync(out);
  Require(back.reference == sync.reference && back.fps == sync.fps && back.cameras.size() == sync.cameras.size(),
          "the file changed");
  for (size_t i = 0; i < sync.cameras.size(); ++i) {
    Require(back.cameras[i].name == sync.cameras[i].name && back.cameras[i].offset_frames == sync.cameras[i].offset_frames &&
                back.cameras[i].sigma_frames == sync.cameras[i].sigma_frames,
            "a camera changed");
  }
}

}  // namespace mvstudio::fuzz
