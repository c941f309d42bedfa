#include "calib/resection.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "calib/homography.h"

namespace mvstudio::calib {
namespace {

using geometry::Camera;
using geometry::Rigid3;
using geometry::Vector6d;

Resection Failed(Status status) {
  Resection result;
  result.status = status;
  result.rms_px = result.other_rms_px = std::numeric_limits<double>::infinity();
  return result;
}

/// Pose from the homography (board metres to normalised coordinates) by its first two columns.
std::optional<Rigid3> PoseFromHomography(const Eigen::Matrix3d& homography, const Eigen::Vector3d& center_in_board) {
  Eigen::Matrix3d h = homography;
  const double first = h.col(0).norm(), second = h.col(1).norm();
  // Both are the same for a rotation; far from that, the corners were nearly on a line.
  constexpr double kMaxRatio = 1e3;
  if (!(first < kMaxRatio * second && second < kMaxRatio * first)) return std::nullopt;
  h /= std::sqrt(first * second);
  if ((h * Eigen::Vector3d(center_in_board.x(), center_in_board.y(), 1)).z() < 0) h = -h;
  Eigen::Matrix3d r;
  r << h.col(0), h.col(1), h.col(0).cross(h.col(1));
  if (!(r.determinant() > 1e-6)) return std::nullopt;
  Rigid3 pose;
  pose.rotation = geometry::NearestRotation(r);
  pose.translation = h * Eigen::Vector3d(center_in_board.x(), center_in_board.y(), 1) - pose.rotation * center_in_board;
  return pose;
}

/// The other orientation of a plane that gives nearly the same image: depths mirrored at the plane through the board's centre
/// across the line of sight.
Rigid3 MirroredPose(const Rigid3& cam_from_board, const Eigen::Vector3d& center_in_board) {
  const Eigen::Vector3d center_in_cam = cam_from_board * center_in_board;
  const Eigen::Vector3d sight = center_in_cam.normalized();
  const Eigen::Matrix3d mirror = Eigen::Matrix3d::Identity() - 2 * sight * sight.transpose();
  const Eigen::Matrix3d r = mirror * cam_from_board.rotation.toRotationMatrix() * Eigen::Vector3d(1, 1, -1).asDiagonal();
  Rigid3 pose;
  pose.rotation = geometry::NearestRotation(r);
  pose.translation = center_in_cam - pose.rotation * center_in_board;
  return pose;
}

std::optional<Eigen::Matrix3d> NormalizedHomography(const Camera& camera, const View& view) {
  const geometry::Projector projector(camera);
  Eigen::Matrix2Xd from(2, view.size()), to(2, view.size());
  Eigen::Index n = 0;
  for (Eigen::Index i = 0; i < view.size(); ++i) {
    if (view.weights[i] <= 0) continue;
    const geometry::Unprojection ray = projector.Unproject(view.px.col(i));
    if (ray.status != Status::kOk || ray.ray_in_cam.z() < 0.05) continue;
    from.col(n) = view.x_in_board.col(i).head<2>();
    to.col(n++) = ray.ray_in_cam.hnormalized();
  }
  return FitHomography(from.leftCols(n), to.leftCols(n));
}

double SquaredCost(const Camera& camera, const View& view, const Rigid3& pose) {
  const auto residuals = ResidualsOf(view, camera, pose);
  if (!residuals) return std::numeric_limits<double>::infinity();
  double cost = 0;
  for (Eigen::Index i = 0; i < view.size(); ++i) {
    if (view.weights[i] > 0) cost += view.weights[i] * residuals->col(i).squaredNorm();
  }
  return cost;
}

}  // namespace

Resection RefinePose(const Camera& camera, const View& view, const Rigid3& start) {
  constexpr int kMaxIterations = 50;
  const double weight = view.weights.sum();
  if ((view.weights.array() > 0).count() < 4) return Failed(Status::kTooFewViews);
  Rigid3 pose = start;
  double cost = SquaredCost(camera, view, pose), damping = 1e-4;
  if (!std::isfinite(cost)) return Failed(Status::kBehindCamera);
  for (int i = 0; i < kMaxIterations && damping < 1e10; ++i) {
    const auto linear = LinearizeView(view, camera, pose, Rigid3());
    if (!linear) return Failed(Status::kBehindCamera);
    Eigen::Matrix<double, 6, 6> hessian = linear->d_cam.transpose() * linear->d_cam;
    hessian.diagonal() *= 1 + damping;
    const Vector6d step = hessian.ldlt().solve(-linear->d_cam.transpose() * linear->residuals);
    if (!step.allFinite()) return Failed(Status::kDegenerate);
    const Rigid3 next = geometry::Perturb(step, pose);
    const double next_cost = SquaredCost(camera, view, next);
    if (next_cost <= cost) {
      const bool done = cost - next_cost <= 1e-14 * cost || step.norm() < 1e-14;
      pose = next, cost = next_cost, damping *= 0.1;
      if (done) break;
    } else {
      damping *= 10;
    }
  }
  Resection result;
  result.cam_from_board = pose;
  result.rms_px = result.other_rms_px = std::sqrt(cost / weight);
  return result;
}

Resection ResectPlane(const Camera& camera, const View& view) {
  if (!view.px.allFinite()) return Failed(Status::kNonFiniteInput);
  if ((view.weights.array() > 0).count() < 4) return Failed(Status::kTooFewViews);
  const auto homography = NormalizedHomography(camera, view);
  if (!homography) return Failed(Status::kDegenerate);
  const Eigen::Vector3d center = view.x_in_board.rowwise().mean();
  const auto start = PoseFromHomography(*homography, center);
  if (!start) return Failed(Status::kDegenerate);
  Resection first = RefinePose(camera, view, *start);
  const Resection second =
      RefinePose(camera, view, MirroredPose(first.status == Status::kOk ? first.cam_from_board : *start, center));
  if (first.status != Status::kOk && second.status != Status::kOk) return first;
  Resection best =
      second.status == Status::kOk && (first.status != Status::kOk || second.rms_px < first.rms_px) ? second : first;
  best.other_rms_px = std::max(first.rms_px, second.rms_px);
  return best;
}

}  // namespace mvstudio::calib
