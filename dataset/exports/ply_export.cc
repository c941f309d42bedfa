#include <nlohmann/json.hpp>

#include "dataset/exports/frustum.h"
#include "dataset/exports/joint_files.h"
#include "dataset/exports/writers.h"
#include "geometry/rig/rig_io.h"
#include "geometry/skeleton/skeleton.h"

/// rig.ply and a PLY of the skeletons for every frame: MeshLab, CloudCompare and Blender show their edges. Metres, the
/// dataset's axes.
namespace mvstudio::exports {
namespace {

/// The calibration file without blanks, in pieces that every reader's line can hold: the outlines do not tell the lenses.
std::vector<std::string> CalibrationLines(const Take& take) {
  constexpr size_t kPieceBytes = 180;
  const std::string compact = nlohmann::ordered_json::parse(geometry::RigToJsonText(RigOf(take, AllViews(take)))).dump();
  std::string text;
  for (const char c : compact) text += c == ' ' ? "\\u0020" : std::string(1, c);
  std::vector<std::string> lines;
  for (size_t at = 0; at < text.size(); at += kPieceBytes) lines.push_back("calibration " + text.substr(at, kPieceBytes));
  return lines;
}

std::string RigPly(const Take& take) {
  std::vector<ColouredPoint> points;
  std::vector<std::pair<int, int>> edges;
  for (const View& view : take.views) {
    const int first = static_cast<int>(points.size());
    const geometry::Rigid3 world_from_cam = Inverse(view.camera.cam_from_world);
    for (const Eigen::Vector3d& x_in_cam : FrustumInCam(view.camera.camera)) {
      points.push_back({world_from_cam * x_in_cam, {40, 120, 230}});
    }
    points[static_cast<size_t>(first)].rgb = {230, 60, 40};
    for (const auto& edge : kFrustumEdges) edges.emplace_back(first + edge[0], first + edge[1]);
  }
  std::vector<std::string> comments = CalibrationLines(take);
  comments.insert(comments.begin(), "cameras: centre and image corners; metres, axes of the dataset's world");
  return PlyText(points, edges, comments);
}

std::string SkeletonPly(const Take& take, int frame) {
  const geometry::Skeleton& skeleton = SkeletonOf(take);
  std::vector<ColouredPoint> points;
  std::vector<std::pair<int, int>> edges;
  for (const auto& [id, unused] : take.At(frame)) {
    const auto pose = JointsOf(take, frame, id);
    if (!pose) continue;
    std::vector<int> index(skeleton.joints.size(), -1);
    for (size_t j = 0; j < index.size(); ++j) {
      index[j] = pose->valid[j] ? static_cast<int>(points.size()) : -1;
      if (pose->valid[j]) points.push_back({pose->x_in_world.col(static_cast<Eigen::Index>(j)), {230, 120, 40}});
    }
    const auto colours = BoneColours(skeleton);
    for (size_t bone = 0; bone < skeleton.bones.size(); ++bone) {
      const int from = index[static_cast<size_t>(skeleton.bones[bone].first)];
      const int to = index[static_cast<size_t>(skeleton.bones[bone].second)];
      if (from < 0 || to < 0) continue;
      edges.emplace_back(from, to);
      if (!skeleton.colours.empty()) points[static_cast<size_t>(to)].rgb = colours[bone];
    }
  }
  return PlyText(points, edges, {"joints; metres, axes of the dataset's world"});
}

}  // namespace

std::array<Eigen::Vector3d, 5> FrustumInCam(const geometry::Camera& camera) {
  const geometry::Projector projector(camera);
  const double right = camera.width_px - 0.5, bottom = camera.height_px - 0.5;
  const Eigen::Vector2d corners[] = {{-0.5, -0.5}, {right, -0.5}, {right, bottom}, {-0.5, bottom}};
  std::array<Eigen::Vector3d, 5> points;
  points.fill(Eigen::Vector3d::Zero());
  for (size_t i = 0; i < 4; ++i) {
    const geometry::Unprojection ray = projector.Unproject(corners[i]);
    if (ray.status == Status::kOk) points[i + 1] = kFrustumDepthM * ray.ray_in_cam;
  }
  return points;
}

void WritePly(const Job& job) {
  job.Write("rig.ply", RigPly(job.take));
  for (const int frame : job.take.frames) {
    job.Write(Numbered("skeleton/", frame, 8, ".ply"), SkeletonPly(job.take, frame));
  }
}

}  // namespace mvstudio::exports
