#include "triangulate/prepared_rig.h"

#include <cmath>

#include "core/check.h"

namespace mvstudio::triangulate {

PreparedRig Prepare(const geometry::Rig& rig, bool ignore_distortion) {
  PreparedRig prepared;
  for (const geometry::RigCamera& camera : rig.cameras) {
    prepared.origin_in_world += camera.CenterInWorld() / static_cast<double>(rig.cameras.size());
  }
  for (const geometry::RigCamera& camera : rig.cameras) {
    const geometry::Camera lens = ignore_distortion ? geometry::PinholeOf(camera.camera) : camera.camera;
    const geometry::Camera axis = geometry::PinholeOf(lens);
    const Eigen::Matrix3d rotation = camera.cam_from_world.rotation.toRotationMatrix();
    const Eigen::Vector3d translation = rotation * prepared.origin_in_world + camera.cam_from_world.translation;
    const double rounding = 1e-15 * (camera.cam_from_world.translation.norm() + prepared.origin_in_world.norm());
    prepared.cameras.push_back({lens.name, geometry::Projector(lens), rotation, translation,
                                -rotation.transpose() * translation, std::sqrt(axis.fx() * axis.fy()), rounding});
  }
  return prepared;
}

std::vector<View> MakeViews(const PreparedRig& rig, const std::vector<Observation>& observations, Status* rejected) {
  *rejected = Status::kOk;
  const auto reject = [rejected](Status reason) {
    if (*rejected == Status::kOk) *rejected = reason;
  };
  std::vector<View> views;
  views.reserve(observations.size());
  for (size_t i = 0; i < observations.size(); ++i) {
    const Observation& seen = observations[i];
    MVS_CHECK(seen.camera_idx >= 0 && seen.camera_idx < static_cast<int>(rig.cameras.size()), "no camera " << seen.camera_idx);
    const PreparedCamera& camera = rig.cameras[seen.camera_idx];
    if (!seen.px.allFinite() || !std::isfinite(seen.sigma_px) || !(seen.sigma_px > 0)) {
      reject(Status::kNonFiniteInput);
      continue;
    }
    const geometry::Unprojection ray = camera.projector.Unproject(seen.px);
    if (ray.status != Status::kOk) {
      reject(ray.status);
      continue;
    }
    views.push_back({&camera, seen.px, seen.sigma_px, seen.sigma_px / camera.focal_px,
                     camera.cam_from_local_rotation.transpose() * ray.ray_in_cam, static_cast<int>(i)});
  }
  return views;
}

}  // namespace mvstudio::triangulate
