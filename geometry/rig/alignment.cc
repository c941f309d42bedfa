#include "geometry/rig/alignment.h"

#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"

namespace mvstudio::geometry {
namespace {

/// Frobenius norm without overflow. (Eigen's own stableNorm is for vectors.)
double StableNorm(const Eigen::Matrix3Xd& points) {
  return Eigen::Map<const Eigen::VectorXd>(points.data(), points.size()).stableNorm();
}

/// True when the centred points (3, N), scaled to unit norm, lie on one line up to rounding of coordinates as large as
/// `magnitude`.
bool Collinear(const Eigen::Matrix3Xd& centred, double magnitude) {
  const Eigen::MatrixXd tall = centred.transpose();
  const Eigen::MatrixXd upper =
      Eigen::HouseholderQR<Eigen::MatrixXd>(tall).matrixQR().topRows<3>().triangularView<Eigen::Upper>();
  const Eigen::Vector3d size = Eigen::JacobiSVD<Eigen::Matrix3d>(Eigen::Matrix3d(upper)).singularValues();
  const double rounding =
      8 * std::numeric_limits<double>::epsilon() * magnitude * std::sqrt(static_cast<double>(centred.cols()));
  return size[1] <= std::max(1e-9 * size[0], rounding);
}

/// Centre and both axes' ends of every camera, `lever` metres long: points that carry position and orientation. // (3, 6 C)
Eigen::Matrix3Xd CameraMarkers(const std::vector<const RigCamera*>& cameras, double lever) {
  Eigen::Matrix3Xd markers(3, 6 * static_cast<Eigen::Index>(cameras.size()));
  Eigen::Index column = 0;
  for (const RigCamera* camera : cameras) {
    const Rigid3 world_from_cam = Inverse(camera->cam_from_world);
    for (int axis = 0; axis < 3; ++axis) {
      markers.col(column++) = world_from_cam * (lever * Eigen::Vector3d::Unit(axis));
      markers.col(column++) = world_from_cam * (-lever * Eigen::Vector3d::Unit(axis));
    }
  }
  return markers;
}

/// RMS distance of the camera centres from their mean, 1 m when they coincide.
double Lever(const std::vector<const RigCamera*>& cameras) {
  Eigen::Matrix3Xd centres(3, static_cast<Eigen::Index>(cameras.size()));
  for (size_t i = 0; i < cameras.size(); ++i) centres.col(static_cast<Eigen::Index>(i)) = cameras[i]->CenterInWorld();
  const Eigen::Vector3d mean = centres.rowwise().mean();
  const double spread = (centres.colwise() - mean).norm() / std::sqrt(static_cast<double>(cameras.size()));
  return spread > 1e-9 * (1 + mean.norm()) ? spread : 1.0;
}

double FocalDifference(const Camera& camera, const Camera& reference) {
  return std::max(std::abs(camera.fx() - reference.fx()) / reference.fx(),
                  std::abs(camera.fy() - reference.fy()) / reference.fy());
}

/// Over a grid of 17 x 17 pixels of the reference's image; infinity where only one lens sees the ray.
double LensDifference(const Camera& camera, const Camera& reference) {
  constexpr int kSteps = 16;
  const Projector projector(camera), reference_projector(reference);
  double largest = 0;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const Eigen::Vector2d px((reference.width_px - 1.0) * i / kSteps, (reference.height_px - 1.0) * j / kSteps);
      const Unprojection ray = reference_projector.Unproject(px);
      if (ray.status != Status::kOk) continue;
      const Projection other = projector.Project(ray.ray_in_cam);
      const double distance = other.status == Status::kOk ? (other.px - px).norm() : std::numeric_limits<double>::infinity();
      largest = std::max(largest, distance);
    }
  }
  return largest;
}

}  // namespace

Alignment AlignPoints(const Eigen::Matrix3Xd& x_in_a, const Eigen::Matrix3Xd& x_in_b, bool with_scale) {
  MVS_CHECK(x_in_a.cols() == x_in_b.cols(), x_in_a.cols() << " points in a, " << x_in_b.cols() << " in b");
  Alignment result;
  if (!x_in_a.allFinite() || !x_in_b.allFinite())
    result.status = Status::kNonFiniteInput;
  else if (x_in_a.cols() < 3)
    result.status = Status::kTooFewViews;
  if (result.status != Status::kOk) return result;
  const Eigen::Vector3d mean_a = x_in_a.rowwise().mean(), mean_b = x_in_b.rowwise().mean();
  const Eigen::Matrix3Xd a = x_in_a.colwise() - mean_a, b = x_in_b.colwise() - mean_b;
  // Scaled to unit size first, so that neither tiny nor huge coordinates leave the range of squares.
  const double size_a = StableNorm(a), size_b = StableNorm(b);
  if (size_a == 0 || size_b == 0 || Collinear(a / size_a, x_in_a.lpNorm<Eigen::Infinity>() / size_a) ||
      Collinear(b / size_b, x_in_b.lpNorm<Eigen::Infinity>() / size_b)) {
    result.status = Status::kDegenerate;
    return result;
  }
  const Eigen::Matrix3d cross = (b / size_b) * (a / size_a).transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign(1, 1, svd.matrixU().determinant() * svd.matrixV().determinant() > 0 ? 1 : -1);
  const Eigen::Matrix3d rotation = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  if (with_scale) result.scale = svd.singularValues().dot(sign) * size_b / size_a;
  result.b_from_a.rotation = Eigen::Quaterniond(rotation).normalized();
  result.b_from_a.translation = mean_b - result.scale * (result.b_from_a.rotation * mean_a);
  const Eigen::Matrix3Xd residuals = b - result.scale * (result.b_from_a.rotation.toRotationMatrix() * a);
  result.rms = StableNorm(residuals) / std::sqrt(static_cast<double>(a.cols()));
  return result;
}

RigDifference CompareRigs(const Rig& rig, const Rig& reference) {
  RigDifference difference;
  MVS_CHECK(rig.cameras.size() == reference.cameras.size(),
            rig.cameras.size() << " cameras against " << reference.cameras.size() << " in the reference");
  if (rig.cameras.empty()) {
    difference.status = Status::kTooFewViews;
    return difference;
  }
  std::vector<const RigCamera*> cameras, references;
  for (const RigCamera& camera : reference.cameras) {
    const int found = rig.Find(camera.camera.name);
    MVS_CHECK(found >= 0, "camera '" << camera.camera.name << "' of the reference is not in the rig");
    cameras.push_back(&rig.cameras[found]);
    references.push_back(&camera);
  }
  const double lever = Lever(references);
  const Alignment alignment = AlignPoints(CameraMarkers(cameras, lever), CameraMarkers(references, lever));
  difference.status = alignment.status;
  if (alignment.status != Status::kOk) return difference;
  difference.reference_from_rig = alignment.b_from_a;
  const double count = static_cast<double>(cameras.size());
  for (size_t i = 0; i < cameras.size(); ++i) {
    const Rigid3 cam_from_reference = cameras[i]->cam_from_world * Inverse(alignment.b_from_a);
    const double angle = RotationAngle(cam_from_reference.rotation, references[i]->cam_from_world.rotation);
    const double shift = (alignment.b_from_a * cameras[i]->CenterInWorld() - references[i]->CenterInWorld()).norm();
    difference.max_rotation_rad = std::max(difference.max_rotation_rad, angle);
    difference.max_translation_m = std::max(difference.max_translation_m, shift);
    difference.mean_rotation_rad += angle / count;
    difference.mean_translation_m += shift / count;
    difference.max_focal_relative =
        std::max(difference.max_focal_relative, FocalDifference(cameras[i]->camera, references[i]->camera));
    difference.max_lens_px = std::max(difference.max_lens_px, LensDifference(cameras[i]->camera, references[i]->camera));
  }
  return difference;
}

}  // namespace mvstudio::geometry
