#include "calib/lens/resection.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <cmath>
#include <limits>

#include "calib/board/space_points.h"
#include "geometry/solve/least_squares.h"

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

/// Pose from the homography (board metres to rays) by its first two columns.
std::optional<Rigid3> PoseFromHomography(const Eigen::Matrix3d& homography, const Eigen::Vector3d& center_in_board) {
  Eigen::Matrix3d h = homography;
  const double first = h.col(0).norm(), second = h.col(1).norm();
  // Both are the same for a rotation; far from that, the corners were nearly on a line.
  constexpr double kMaxRatio = 1e3;
  if (!(first < kMaxRatio * second && second < kMaxRatio * first)) return std::nullopt;
  h /= std::sqrt(first * second);
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
  const Eigen::Vector3d view_axis = center_in_cam.normalized();
  const Eigen::Matrix3d mirror = Eigen::Matrix3d::Identity() - 2 * view_axis * view_axis.transpose();
  const Eigen::Matrix3d r = mirror * cam_from_board.rotation.toRotationMatrix() * Eigen::Vector3d(1, 1, -1).asDiagonal();
  Rigid3 pose;
  pose.rotation = geometry::NearestRotation(r);
  pose.translation = center_in_cam - pose.rotation * center_in_board;
  return pose;
}

/// Rays (3, N) of the corners with a weight and their places on the board, in its plane (2, N) and in space (3, N).
struct Bearings {
  Eigen::Matrix2Xd in_board;
  Eigen::Matrix3Xd x_in_board;
  Eigen::Matrix3Xd rays;
};

Bearings UnprojectCorners(const Camera& camera, const View& view) {
  const geometry::Projector projector(camera);
  Bearings out{Eigen::Matrix2Xd(2, view.size()), Eigen::Matrix3Xd(3, view.size()), Eigen::Matrix3Xd(3, view.size())};
  Eigen::Index n = 0;
  for (Eigen::Index i = 0; i < view.size(); ++i) {
    if (view.weights[i] <= 0) continue;
    const geometry::Unprojection ray = projector.Unproject(view.px.col(i));
    if (ray.status != Status::kOk) continue;
    out.in_board.col(n) = view.x_in_board.col(i).head<2>();
    out.x_in_board.col(n) = view.x_in_board.col(i);
    out.rays.col(n++) = ray.ray_in_cam;
  }
  out.in_board.conservativeResize(2, n);
  out.x_in_board.conservativeResize(3, n);
  out.rays.conservativeResize(3, n);
  return out;
}

/// H with H (x, y, 1) along the ray of every corner: least squares of ray x H p, which holds for rays behind the image plane
/// too. Nothing for fewer than 4 corners or corners on a line.
std::optional<Eigen::Matrix3d> BearingHomography(const Bearings& bearings) {
  const Eigen::Index n = bearings.rays.cols();
  if (n < 4) return std::nullopt;
  const Eigen::Vector2d center = bearings.in_board.rowwise().mean();
  const double size = std::sqrt((bearings.in_board.colwise() - center).squaredNorm() / n);
  if (!(size > 0)) return std::nullopt;
  Eigen::MatrixXd rows(3 * n, 9);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector2d p = (bearings.in_board.col(i) - center) / size;
    const Eigen::Vector3d v = bearings.rays.col(i);
    Eigen::Matrix3d cross;
    cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
    rows.middleRows<3>(3 * i) << p.x() * cross, p.y() * cross, cross;
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(rows);
  const Eigen::Matrix<double, 9, 9> triangle = qr.matrixQR().topRows<9>().triangularView<Eigen::Upper>();
  const Eigen::JacobiSVD<Eigen::Matrix<double, 9, 9>> svd(triangle, Eigen::ComputeFullV);
  constexpr double kMinRatio = 1e-10;
  if (!(svd.singularValues()[7] > kMinRatio * svd.singularValues()[0])) return std::nullopt;
  const Eigen::Matrix<double, 9, 1> h = svd.matrixV().col(8);
  Eigen::Matrix3d homography;
  homography << h.head<3>(), h.segment<3>(3), h.tail<3>();
  Eigen::Matrix3d normalize;
  normalize << 1 / size, 0, -center.x() / size, 0, 1 / size, -center.y() / size, 0, 0, 1;
  homography = homography * normalize;
  double side = 0;
  for (Eigen::Index i = 0; i < n; ++i) side += bearings.rays.col(i).dot(homography * bearings.in_board.col(i).homogeneous());
  return side < 0 ? Eigen::Matrix3d(-homography) : homography;
}

struct ViewPoseProblem : geometry::LeastSquaresProblem<6, Rigid3> {
  const Camera& camera;
  const View& view;
  static constexpr bool kHasCost = true;

  ViewPoseProblem(const Camera& of_camera, const View& of_view) : camera(of_camera), view(of_view) {}
  Rigid3 Retract(const Rigid3& pose, const Vector6d& step) const { return geometry::Perturb(step, pose); }

  double Cost(const Rigid3& pose) const {
    const auto residuals = ResidualsOf(view, camera, pose);
    if (!residuals) return std::numeric_limits<double>::infinity();
    double cost = 0;
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      if (view.weights[i] > 0) cost += view.weights[i] * residuals->col(i).squaredNorm();
    }
    return cost;
  }

  bool Linearize(const Rigid3& pose, Equations* out) const {
    const auto linear = LinearizeView(view, camera, pose, false);
    if (!linear) return false;
    out->h.noalias() = linear->d_pose.transpose() * linear->d_pose;
    out->g.noalias() = linear->d_pose.transpose() * linear->residuals;
    return true;
  }
};

}  // namespace

Resection RefinePose(const Camera& camera, const View& view, const Rigid3& start) {
  if ((view.weights.array() > 0).count() < 4) return Failed(Status::kTooFewViews);
  geometry::LeastSquaresOptions options;
  options.step_tolerance = 1e-14;
  const auto end = geometry::SolveLeastSquares(ViewPoseProblem(camera, view), start, options);
  if (end.status == Status::kNonFiniteInput) return Failed(Status::kBehindCamera);
  if (end.status == Status::kDegenerate) return Failed(end.status);
  Resection result;
  result.cam_from_board = end.state;
  result.rms_px = result.other_rms_px = std::sqrt(end.equations.cost / view.weights.sum());
  return result;
}

namespace {

/// Points off a plane have one pose.
Resection ResectSpace(const Camera& camera, const View& view) {
  const Bearings seen = UnprojectCorners(camera, view);
  const auto start = PoseInSpace(seen.x_in_board, seen.rays);
  return start ? RefinePose(camera, view, *start) : Failed(Status::kDegenerate);
}

}  // namespace

Resection ResectPlane(const Camera& camera, const View& view) {
  if (!view.px.allFinite()) return Failed(Status::kNonFiniteInput);
  if ((view.weights.array() > 0).count() < 4) return Failed(Status::kTooFewViews);
  if (SpansSpace(view.x_in_board, view.weights)) {
    const Resection in_space = ResectSpace(camera, view);
    if (in_space.status == Status::kOk || in_space.status == Status::kNotConverged) return in_space;
  }
  const auto homography = BearingHomography(UnprojectCorners(camera, view));
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
