#include "stages/nets/pose2d/existing.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "dataset/footage/frames.h"
#include "stages/input/score_input.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

std::vector<std::string> CamerasOf(const std::string& folder, const std::vector<dataset::CameraFootage>& footage) {
  std::vector<std::string> names;
  for (const dataset::CameraFootage& camera : footage) names.push_back(camera.camera);
  if (!names.empty()) return names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.is_directory()) names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

/// Joints that cannot be right become not detected; returns how many.
int Normalise(double width, double height, dataset::Pose2dTrack* track) {
  int dropped = 0;
  for (auto& [frame, people] : track->frames) {
    for (dataset::Person2d& person : people) {
      for (dataset::Keypoint2d& joint : person.keypoints) {
        if (joint.score == 0) continue;
        const bool finite = std::isfinite(joint.x_px) && std::isfinite(joint.y_px) && std::isfinite(joint.score);
        bool right = finite && joint.score > 0;
        if (width > 0)
          right = right && std::abs(joint.x_px - width / 2) < 1.5 * width && std::abs(joint.y_px - height / 2) < 1.5 * height;
        if (!right) joint = {}, ++dropped;
        joint.score = std::min(joint.score, 1.0);
      }
    }
  }
  return dropped;
}

}  // namespace

int FramesOf(const dataset::CameraFootage& footage) {
  try {
    return static_cast<int>(dataset::DescribeFootage(footage.path).num_frames);
  } catch (const Error&) {
    return 0;  // reading it will say why
  }
}

std::vector<CameraPoses> ReadExistingPoses(const std::string& folder, const std::vector<dataset::CameraFootage>& footage,
                                           const geometry::Skeleton& skeleton, InputNotes* notes) {
  if (!fs::is_directory(folder)) throw UsageError("option 'backend' openpose:" + folder + ": there is no such folder");
  std::vector<CameraPoses> cameras;
  for (const std::string& name : CamerasOf(folder, footage)) {
    CameraPoses camera;
    camera.track = dataset::ReadOpenPoseFolder(folder + "/" + name, name, skeleton);
    if (camera.track.normalized)
      throw FormatError(folder + "/" + name, "", "YOLO's labels have no pixels; give them to triangulate, option 'pose2d'");
    notes->inputs.push_back(folder + "/" + name);
    camera.damage = camera.track.skipped;
    for (const dataset::CameraFootage& f : footage) {
      if (f.camera != name) continue;
      const dataset::FootageInfo info = dataset::DescribeFootage(f.path);
      camera.width = info.width, camera.height = info.height;
    }
    std::vector<dataset::Pose2dTrack> alone = {std::move(camera.track)};
    ScoresToShares({}, false, &alone, notes);
    camera.track = std::move(alone[0]);
    const int dropped = Normalise(camera.width, camera.height, &camera.track);
    if (dropped > 0)
      notes->warnings.push_back({"POSE-JOINTS",
                                 name + ": " + std::to_string(dropped) + " joints have no usable position or score",
                                 "they count as not detected"});
    for (const auto& [frame, people] : camera.track.frames) ++camera.frames, camera.frames_with_people += !people.empty();
    cameras.push_back(std::move(camera));
  }
  if (cameras.empty()) throw UsageError("option 'backend' openpose:" + folder + ": has no folder of a camera in it");
  return cameras;
}

}  // namespace mvstudio::stages
