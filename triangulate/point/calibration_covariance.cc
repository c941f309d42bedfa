#include "triangulate/point/calibration_covariance.h"

#include <algorithm>

#include "geometry/lens/lens_derivatives.h"
#include "geometry/rigid/cross_matrix.h"

namespace mvstudio::triangulate {
namespace {

/// (3, P + 6): J_x^T J_theta / s^2 of one view, theta = lens parameters and pose; false where the lens's formula is undefined.
bool Gradient(const PreparedRig& rig, const Observation& seen, const Eigen::Vector3d& x_in_world,
              Eigen::Ref<Eigen::MatrixXd> out) {
  Eigen::MatrixXd by_calibration = Eigen::MatrixXd::Zero(2, out.cols());
  Eigen::Matrix<double, 2, 3> by_x;
  if (!ProjectionByCalibration(rig, static_cast<size_t>(seen.camera_idx), x_in_world, by_calibration, &by_x)) return false;
  out = by_x.transpose() / (seen.sigma_px * seen.sigma_px) * by_calibration;
  return true;
}

}  // namespace

bool ProjectionByCalibration(const PreparedRig& rig, size_t camera_idx, const Eigen::Vector3d& x_in_world,
                             Eigen::Ref<Eigen::MatrixXd> out, Eigen::Matrix<double, 2, 3>* by_x) {
  const PreparedCamera& camera = rig.cameras[camera_idx];
  Eigen::Vector2d px;
  geometry::LensDerivatives lens;
  const Eigen::Vector3d x_in_cam = camera.ToCam(x_in_world - rig.origin_in_world);
  if (!geometry::ProjectLens(camera.projector.camera(), x_in_cam, &px, &lens)) return false;
  const Eigen::Matrix3d& rotation = camera.cam_from_local_rotation;
  *by_x = lens.d_px_d_x_in_cam * rotation;
  for (int k = 0; k < lens.count; ++k) out.col(lens.columns[static_cast<size_t>(k)]) = lens.d_px.col(k);
  const Eigen::Index p = camera.projector.camera().params.size();
  out.middleCols<3>(p) = -lens.d_px_d_x_in_cam * geometry::CrossMatrix(Eigen::Vector3d(rotation * x_in_world));
  out.middleCols<3>(p + 3) = lens.d_px_d_x_in_cam;
  return true;
}

void AddCalibrationCovariance(const PreparedRig& rig, const std::vector<Observation>& observations, Point* point) {
  if (point->status != Status::kOk) return;
  point->num_unknown_cameras = static_cast<int>(std::count_if(point->used.begin(), point->used.end(), [&](int used) {
    return !rig.covariance_known[static_cast<size_t>(observations[static_cast<size_t>(used)].camera_idx)];
  }));
  if (rig.covariance.size() == 0) return;
  std::vector<Eigen::Index> begin, size;
  Eigen::Index total = 0;
  for (const int used : point->used) {
    const size_t c = static_cast<size_t>(observations[static_cast<size_t>(used)].camera_idx);
    begin.push_back(rig.covariance_begin[c]);
    size.push_back(rig.covariance_begin[c + 1] - rig.covariance_begin[c]);
    total += size.back();
  }
  Eigen::MatrixXd gradient = Eigen::MatrixXd::Zero(3, total), covariance(total, total);
  Eigen::Index row = 0;
  for (size_t i = 0; i < begin.size(); ++i) {
    const Observation& seen = observations[static_cast<size_t>(point->used[i])];
    if (!Gradient(rig, seen, point->x_in_world, gradient.middleCols(row, size[i]))) return;
    Eigen::Index col = 0;
    for (size_t j = 0; j < begin.size(); ++j) {
      covariance.block(row, col, size[i], size[j]) = rig.covariance.block(begin[i], begin[j], size[i], size[j]);
      col += size[j];
    }
    row += size[i];
  }
  const Eigen::Matrix3d& own = point->covariance;
  const Eigen::Matrix3d added = own * (gradient * covariance * gradient.transpose()) * own;
  point->calibration_covariance = 0.5 * (added + added.transpose());
  point->covariance += point->calibration_covariance;
}

}  // namespace mvstudio::triangulate
