#include "stages/view/scene_parts.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "core/error.h"
#include "core/statistics.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/video_io.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

constexpr int kPlainSidePx = 720;
constexpr double kPlainDistance = 12;  // in lengths of what is seen

struct PlainView {
  const char* name;
  double rows[9];  // of the rotation cam_from_world
};
constexpr PlainView kPlainViews[] = {{"front", {1, 0, 0, 0, 0, -1, 0, 1, 0}},
                                     {"left side", {0, 1, 0, 0, 0, -1, -1, 0, 0}},
                                     {"above", {1, 0, 0, 0, -1, 0, 0, 0, -1}}};

geometry::RigCamera PlainCamera(const PlainView& view, const Eigen::Vector3d& centre, double size_m) {
  geometry::RigCamera camera;
  camera.camera.name = view.name;
  camera.camera.model = geometry::LensModel::kPinhole;
  camera.camera.width_px = camera.camera.height_px = kPlainSidePx;
  const double focal_px = 0.9 * kPlainSidePx * kPlainDistance, middle = 0.5 * (kPlainSidePx - 1);
  camera.camera.params = Eigen::Vector4d(focal_px, focal_px, middle, middle);
  Eigen::Matrix3d rotation;
  for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = view.rows[i];
  camera.cam_from_world.rotation = Eigen::Quaterniond(rotation);
  camera.cam_from_world.translation = Eigen::Vector3d(0, 0, kPlainDistance * size_m) - rotation * centre;
  return camera;
}

/// The bones, between joints of these names, of the known skeleton that has most of them.
std::vector<std::pair<int, int>> BonesByName(const geometry::Skeleton& points) {
  std::vector<std::pair<int, int>> most;
  for (const std::string& name : geometry::SkeletonNames()) {
    const geometry::Skeleton& known = geometry::SkeletonByName(name);
    std::vector<std::pair<int, int>> bones;
    for (const auto& [a, b] : known.bones) {
      const int from = points.Find(known.joints[static_cast<size_t>(a)]),
                to = points.Find(known.joints[static_cast<size_t>(b)]);
      if (from >= 0 && to >= 0) bones.emplace_back(from, to);
    }
    if (bones.size() > most.size()) most = std::move(bones);
  }
  return most;
}

}  // namespace

bool LiesIn(const std::string& path, const std::string& folder) {
  std::error_code none;
  const fs::path real = fs::weakly_canonical(path, none), root = fs::weakly_canonical(folder, none);
  if (none) return false;
  const auto [end, unused] = std::mismatch(root.begin(), root.end(), real.begin(), real.end());
  return end == root.end();
}

void RequireInside(const std::string& path, const std::string& folder) {
  if (!folder.empty() && !LiesIn(path, folder))
    throw UsageError(path + ": lies outside of " + folder + "; give option 'allow-outside' to read it");
}

std::vector<int64_t> FrameNumbersOf(const std::string& footage) {
  const dataset::FootageFiles files = dataset::ListFootage(footage);
  std::vector<int64_t> numbers = files.images.numbers;
  if (files.is_video) {
    int64_t count = 0;
    for (const std::string& path : files.paths) count += static_cast<int64_t>(dataset::ReadVideoTimes(path).time_s.size());
    numbers.resize(static_cast<size_t>(count));
    for (int64_t i = 0; i < count; ++i) numbers[static_cast<size_t>(i)] = i;
  }
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

void UsePose3d(const dataset::Pose3d& pose, Scene* scene) {
  scene->skeleton = dataset::SkeletonOf(pose);
  if (scene->skeleton.bones.empty()) scene->skeleton.bones = BonesByName(scene->skeleton);
  scene->joints = dataset::ToJoints(pose, scene->skeleton);
  if (pose.frame_rate_hz > 0) scene->fps_hz = pose.frame_rate_hz;
  std::map<int, std::vector<double>> rms_px;
  for (const dataset::JointRow& row : pose.rows) {
    if (row.status == Status::kOk && row.num_views > 0) rms_px[row.frame].push_back(row.rms_px);
  }
  scene->error_px.clear();
  for (const auto& [step, values] : rms_px) scene->error_px[step] = LinearQuantile(values, 0.5);
}

void UseCoco19(const std::map<int, std::map<int, dataset::Coco19Pose>>& poses, Scene* scene) {
  scene->skeleton = geometry::SkeletonByName("coco19");
  for (const auto& [step, people] : poses) {
    auto& at = scene->joints[step];
    for (const auto& [person, pose] : people) {
      at[person] = {pose.x_in_world, std::vector<bool>(pose.valid.begin(), pose.valid.end()),
                    std::vector<double>(pose.confidence.begin(), pose.confidence.end())};
    }
  }
}

void AddPlainCameras(Scene* scene) {
  Eigen::Array3d low = Eigen::Array3d::Constant(INFINITY), high = -low;
  for (const auto& [step, people] : scene->joints) {
    for (const auto& [person, pose] : people) {
      for (size_t j = 0; j < pose.valid.size(); ++j) {
        if (!pose.valid[j]) continue;
        const Eigen::Array3d x = pose.x_in_world.col(static_cast<Eigen::Index>(j)).array();
        low = low.min(x), high = high.max(x);
      }
    }
  }
  if ((low > high).any()) return;
  const double size_m = std::max(1e-3, (high - low).maxCoeff());
  for (const PlainView& view : kPlainViews) {
    scene->rig.cameras.push_back(PlainCamera(view, 0.5 * (low + high).matrix(), size_m));
    scene->cameras.push_back({view.name, static_cast<int>(scene->rig.cameras.size()) - 1, "", ""});
  }
}

}  // namespace mvstudio::stages
