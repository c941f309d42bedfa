#include "triangulate/point/prepared_rig.h"

#include <cmath>
#include <utility>

#include "core/check.h"
#include "geometry/rig/rig_covariance.h"

namespace mvstudio::triangulate {

namespace {

bool SameCamera(const geometry::RigCamera& a, const geometry::RigCamera& b) {
  return a.camera.model == b.camera.model && a.camera.params.size() == b.camera.params.size() &&
         a.camera.params == b.camera.params && a.cam_from_world.translation == b.cam_from_world.translation &&
         a.cam_from_world.rotation.coeffs() == b.cam_from_world.rotation.coeffs();
}

std::vector<int> FindDuplicates(const geometry::Rig& rig) {
  std::vector<int> duplicate_of(rig.cameras.size(), -1);
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    for (size_t d = 0; d < c && duplicate_of[c] < 0; ++d) {
      if (SameCamera(rig.cameras[c], rig.cameras[d])) duplicate_of[c] = static_cast<int>(d);
    }
  }
  return duplicate_of;
}

void CopyCovariance(const geometry::Rig& rig, PreparedRig* prepared) {
  geometry::StatedCovariance stated = geometry::StatedCovarianceOf(rig);
  for (size_t c = 0; c < rig.cameras.size(); ++c) prepared->covariance_known[c] = stated.Knows(c);
  if (stated.AnyKnown()) prepared->covariance = std::move(stated.joint);
}

bool SeenBefore(const PreparedRig& rig, const std::vector<Observation>& observations, size_t i) {
  const int original = rig.duplicate_of[static_cast<size_t>(observations[i].camera_idx)];
  if (original < 0) return false;
  for (size_t k = 0; k < observations.size(); ++k) {
    if (k == i || observations[k].px != observations[i].px) continue;
    const int other = observations[k].camera_idx;
    if (other == original || (k < i && rig.duplicate_of[static_cast<size_t>(other)] == original)) return true;
  }
  return false;
}

}  // namespace

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
  prepared.duplicate_of = FindDuplicates(rig);
  prepared.covariance_begin = {0};
  for (const geometry::RigCamera& camera : rig.cameras)
    prepared.covariance_begin.push_back(prepared.covariance_begin.back() + camera.camera.params.size() + 6);
  prepared.covariance_known.assign(rig.cameras.size(), false);
  if (!ignore_distortion) CopyCovariance(rig, &prepared);
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
    if (SeenBefore(rig, observations, i)) continue;
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
