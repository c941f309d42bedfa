#include <cmath>
#include <limits>
#include <set>

#include "core/statistics.h"
#include "stages/view/scene.h"

namespace mvstudio::stages {
namespace {

constexpr double kNoPixel = std::numeric_limits<double>::quiet_NaN();
constexpr double kFarthestShare = 0.1;  // of the image's diagonal: who is farther from a detection is somebody else

JointsPx ProjectedPx(const dataset::JointsPose& pose, const geometry::RigCamera& camera, const geometry::Projector& lens) {
  JointsPx px(pose.valid.size(), {kNoPixel, kNoPixel});
  for (size_t j = 0; j < px.size(); ++j) {
    if (!pose.valid[j]) continue;
    const auto seen = lens.Project(camera.cam_from_world * Eigen::Vector3d(pose.x_in_world.col(static_cast<Eigen::Index>(j))));
    if (seen.status == Status::kOk) px[j] = seen.px;
  }
  return px;
}

JointsPx DetectedPx(const dataset::Person2d& person, const dataset::Pose2dTrack& track, const geometry::Camera* lens) {
  JointsPx px;
  for (const dataset::Keypoint2d& point : person.keypoints) {
    Eigen::Vector2d at(point.x_px, point.y_px);
    if (track.normalized && lens) at = {at.x() * lens->width_px - 0.5, at.y() * lens->height_px - 0.5};
    px.push_back(point.score > 0 ? at : Eigen::Vector2d(kNoPixel, kNoPixel));
  }
  return px;
}

/// Index of each 3D joint among the detected ones, by name; -1: none.
std::vector<int> JointsByName(const Scene& scene) {
  std::vector<int> index;
  for (const std::string& joint : scene.skeleton.joints) index.push_back(scene.detected_skeleton.Find(joint));
  return index;
}

using Arrows = std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>>;

Arrows ArrowsBetween(const JointsPx& projected, const JointsPx& detected, const std::vector<int>& index) {
  Arrows arrows;
  for (size_t j = 0; j < std::min(projected.size(), index.size()); ++j) {
    if (index[j] < 0 || static_cast<size_t>(index[j]) >= detected.size()) continue;
    const Eigen::Vector2d& to = detected[static_cast<size_t>(index[j])];
    if (projected[j].allFinite() && to.allFinite()) arrows.emplace_back(projected[j], to);
  }
  return arrows;
}

double MedianLength(const Arrows& arrows) {
  std::vector<double> lengths;
  for (const auto& [from, to] : arrows) lengths.push_back((to - from).norm());
  return LinearQuantile(lengths, 0.5);
}

/// Each person goes with the nearest detection that nobody nearer took.
void AddResidualArrows(const Scene& scene, const geometry::Camera& lens, SceneView* view) {
  const std::vector<int> index = JointsByName(scene);
  const double farthest = kFarthestShare * std::hypot(lens.width_px, lens.height_px);
  std::vector<std::tuple<double, int, size_t>> pairs;
  for (const auto& [person, projected] : view->projected) {
    for (size_t d = 0; d < view->detected.size(); ++d) {
      const double length = MedianLength(ArrowsBetween(projected, view->detected[d], index));
      if (length < farthest) pairs.emplace_back(length, person, d);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  std::set<int> people;
  std::set<size_t> taken;
  for (const auto& [length, person, d] : pairs) {
    if (people.count(person) > 0 || taken.count(d) > 0) continue;
    people.insert(person), taken.insert(d);
    const Arrows arrows = ArrowsBetween(view->projected.at(person), view->detected[d], index);
    view->residuals.insert(view->residuals.end(), arrows.begin(), arrows.end());
  }
}

}  // namespace

int64_t FrameAt(const Scene& scene, size_t camera_idx, int step) {
  if (!scene.timeline) return step;
  const dataset::CameraTimeline* times = scene.timeline->Find(scene.cameras.at(camera_idx).name);
  const bool known = times && step >= 0 && static_cast<size_t>(step) < times->frame_at.size();
  return known ? times->frame_at[static_cast<size_t>(step)] : -1;
}

SceneView ViewAt(const Scene& scene, size_t camera_idx, int step) {
  const SceneCamera& camera = scene.cameras.at(camera_idx);
  SceneView view;
  view.frame = FrameAt(scene, camera_idx, step);
  const geometry::RigCamera* placed = camera.rig_idx < 0 ? nullptr : &scene.rig.cameras[static_cast<size_t>(camera.rig_idx)];
  const auto people = scene.joints.find(step);
  if (placed && people != scene.joints.end()) {
    const geometry::Projector lens(placed->camera);
    for (const auto& [person, pose] : people->second) view.projected[person] = ProjectedPx(pose, *placed, lens);
  }
  const auto track = scene.detections.find(camera.name);
  if (track == scene.detections.end() || view.frame < 0) return view;
  const auto seen = track->second.frames.find(static_cast<int>(view.frame));
  if (seen == track->second.frames.end()) return view;
  for (const dataset::Person2d& person : seen->second)
    view.detected.push_back(DetectedPx(person, track->second, placed ? &placed->camera : nullptr));
  if (placed) AddResidualArrows(scene, placed->camera, &view);
  return view;
}

double MedianResidualPx(const SceneView& view) { return MedianLength(view.residuals); }

}  // namespace mvstudio::stages
