#include "stages/input/pose3d_input.h"

#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "core/some_of.h"
#include "dataset/build/scene_joints.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/markers.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

using Poses = std::map<int, std::map<int, dataset::Coco19Pose>>;

constexpr char kForms[] =
    "is no 3D joints: a folder with points.csv, a .trc, .c3d, .bvh, .csv, .sto, .npz, .npy or .h5 file, a dataset, or "
    "a folder of body3DScene_*.json, FreeMoCap, DeepLabCut or EasyMocap";

bool AnyJoint(const Poses& poses) {
  for (const auto& [frame, people] : poses) {
    for (const auto& [person, pose] : people) {
      if (std::any_of(pose.valid.begin(), pose.valid.end(), [](bool valid) { return valid; })) return true;
    }
  }
  return false;
}

Poses FromPoints(const std::string& path, const std::string& marker_unit) {
  const dataset::Pose3d pose = dataset::ReadPoints3d(path, marker_unit);
  Poses poses = dataset::ToCoco19(pose);
  const std::vector<std::string> others = dataset::JointsBeyondCoco19(pose);
  if (!AnyJoint(poses) && !others.empty())
    throw FormatError(path, "", "none of its joints is one of the body (" + SomeOf(others) + "): name them as OpenPose does");
  return poses;
}

}  // namespace

Poses ReadSceneFiles(const std::string& folder) {
  Poses scenes;
  for (const auto& [frame, file] : dataset::SceneFilesAt(folder)) scenes[frame] = dataset::ReadBody3dScene(file);
  return scenes;
}

Poses ReadCoco19Poses(const std::string& path, const std::string& marker_unit) {
  const bool head = fs::path(path).filename() == "pose3d.json" && fs::is_regular_file(path);
  if (head || dataset::IsPointsFile(dataset::PointsFileAt(path))) return FromPoints(path, marker_unit);
  Poses poses = ReadSceneFiles(path);
  if (poses.empty()) throw IoError(path, kForms);
  return poses;
}

}  // namespace mvstudio::stages
