#include "stages/input/take_frames.h"

#include <cmath>
#include <map>

#include "core/error.h"
#include "core/join.h"

namespace mvstudio::stages {
namespace {

[[noreturn]] void ThrowUnknownCamera(const std::vector<dataset::Pose2dTrack>& tracks, const geometry::Rig& rig,
                                     const std::string& unknown, const std::string& calib_path) {
  throw FormatError(calib_path, "cameras",
                    "camera " + unknown +
                        " has 2D poses but no calibration; poses: " + Join(tracks, ", ", &dataset::Pose2dTrack::camera) +
                        "; calibrated: " + Join(geometry::CameraNames(rig), ", ") +
                        "; use the calibration's names in option 'pose2d' NAME=FOLDER");
}

triangulate::DetectedPerson ToDetected(const dataset::Person2d& person) {
  triangulate::DetectedPerson detected;
  detected.reserve(person.keypoints.size());
  for (const dataset::Keypoint2d& key : person.keypoints) detected.push_back({{key.x_px, key.y_px}, key.score});
  return detected;
}

}  // namespace

std::vector<triangulate::DetectedFrame> ToFrames(const std::vector<dataset::Pose2dTrack>& tracks, const geometry::Rig& rig,
                                                 const std::string& calib_path, const dataset::FrameRange& range) {
  std::map<int, triangulate::DetectedFrame> frames;
  for (const dataset::Pose2dTrack& track : tracks) {
    const int camera_idx = rig.Find(track.camera);
    if (camera_idx < 0) ThrowUnknownCamera(tracks, rig, track.camera, calib_path);
    const auto end = track.frames.upper_bound(range.last);
    for (auto it = track.frames.lower_bound(range.first); it != end; ++it) {
      triangulate::DetectedFrame& frame = frames[it->first];
      frame.frame = it->first;
      frame.people.resize(rig.cameras.size());
      for (const dataset::Person2d& person : it->second) frame.people[camera_idx].push_back(ToDetected(person));
    }
  }
  std::vector<triangulate::DetectedFrame> list;
  for (auto& [number, frame] : frames) list.push_back(std::move(frame));
  return list;
}

dataset::Pose3d ToPose3d(const triangulate::TakeResult& take, const geometry::Skeleton& skeleton) {
  dataset::Pose3d pose{skeleton.name, {}};
  pose.definition = skeleton;
  pose.rows.reserve(take.points.size());
  for (const triangulate::TakePoint& entry : take.points) {
    dataset::JointRow row;
    row.frame = entry.frame;
    row.person = entry.person;
    row.joint = skeleton.joints[entry.joint_idx];
    row.status = entry.point.status;
    row.num_views = entry.point.num_observations;
    if (row.status == Status::kOk) {
      row.x_in_world = entry.point.x_in_world;
      row.num_views = static_cast<int>(entry.point.used.size());
      row.rms_px = entry.point.rms_px;
      const double trace = entry.point.covariance.trace();
      row.sigma_m = std::sqrt(trace / 3);
      if (trace > 0) row.covariance = entry.point.covariance;
    }
    pose.rows.push_back(std::move(row));
  }
  return pose;
}

}  // namespace mvstudio::stages
