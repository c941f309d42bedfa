#include "dataset/build/scene_joints.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/disk/paths.h"
#include "core/error.h"
#include "dataset/panoptic/panoptic.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::dataset {
namespace {

/// ToCoco19 makes the confidence of it again.
double SigmaOf(double confidence) { return -0.05 * std::log(std::clamp(confidence, 1e-6, 1.0)); }

void AddRows(int frame, const std::map<int, Coco19Pose>& people, std::vector<JointRow>* rows) {
  for (const auto& [person, pose] : people) {
    for (size_t j = 0; j < pose.valid.size(); ++j) {
      JointRow row;
      row.frame = frame, row.person = person, row.joint = geometry::Coco19().joints[j];
      if (pose.valid[j]) {
        row.status = Status::kOk;
        row.x_in_world = pose.x_in_world.col(static_cast<Eigen::Index>(j));
        row.sigma_m = SigmaOf(pose.confidence[j]);
      }
      rows->push_back(std::move(row));
    }
  }
}

}  // namespace

std::map<int, std::string> SceneFilesAt(const std::string& path) {
  namespace fs = std::filesystem;
  std::map<int, std::string> files;
  if (!fs::is_directory(path)) return files;
  const fs::path inside = fs::path(path) / "hdPose3d_stage1_coco19";
  const std::string prefix = "body3DScene_";
  for (const std::string& file : FilesNamed(fs::is_directory(inside) ? inside.string() : path, prefix, ".json")) {
    const std::string digits = fs::path(file).stem().string().substr(prefix.size());
    if (digits.empty() || digits.size() > 9 || digits.find_first_not_of("0123456789") != std::string::npos)
      throw FormatError(file, "", "the file name is not body3DScene_%08d.json");
    files[std::stoi(digits)] = file;
  }
  return files;
}

Pose3d ReadSceneJoints(const std::string& path) {
  const std::map<int, std::string> files = SceneFilesAt(path);
  if (files.empty()) throw IoError(path, "holds no body3DScene_*.json");
  Pose3d pose;
  pose.skeleton = geometry::Coco19().name, pose.definition = geometry::Coco19();
  double first_ms = -1, last_ms = -1;
  for (const auto& [frame, file] : files) {
    const Body3dScene scene = ReadBody3dSceneFile(file);
    AddRows(frame, scene.people, &pose.rows);
    if (frame == files.begin()->first) first_ms = scene.univ_time_ms;
    last_ms = scene.univ_time_ms;
  }
  if (first_ms >= 0 && last_ms > first_ms)
    pose.frame_rate_hz = 1000.0 * (files.rbegin()->first - files.begin()->first) / (last_ms - first_ms);
  return pose;
}

}  // namespace mvstudio::dataset
