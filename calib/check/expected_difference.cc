#include "calib/check/expected_difference.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/random.h"
#include "geometry/rig/alignment.h"
#include "geometry/rig/rig_covariance.h"

namespace mvstudio::calib {
namespace {

using geometry::Rig;
using geometry::RigCamera;
using geometry::Rigid3;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr int kNumSamples = 200;

struct Ray {
  Eigen::Vector3d direction;
  bool in_focus;
};

/// The grid of CompareProjection: a coarser one would give the image's border more weight.
std::vector<Ray> Rays(const geometry::Camera& lens, const ProjectionDiffOptions& options) {
  std::vector<Ray> rays;
  const int cols = options.grid_cols;
  const int rows = std::max(2, static_cast<int>(std::lround(1.0 * cols * lens.height_px / lens.width_px)));
  const geometry::Projector projector(lens);
  const Eigen::Vector2d last(lens.width_px - 1, lens.height_px - 1), centre = 0.5 * last;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < cols; ++c) {
      const Eigen::Vector2d px(last.x() * c / (cols - 1), last.y() * r / (rows - 1));
      const geometry::Unprojection ray = projector.Unproject(px);
      if (ray.status == Status::kOk)
        rays.push_back({ray.ray_in_cam, (px - centre).norm() <= options.focus * centre.norm() * (1 + 1e-9)});
    }
  }
  return rays;
}

/// Derivatives of one ray's pixel at a range, by the motion of the camera frame (2, 6) and by the parameters (2, P).
struct Rows {
  bool seen = false;
  Eigen::Matrix<double, 2, 6> motion;
  Eigen::Matrix<double, 2, Eigen::Dynamic> params;
};

Rows RowsOf(const geometry::Projector& projector, const Eigen::Vector3d& ray, double range_m) {
  Rows rows;
  const bool far = std::isinf(range_m);
  const Eigen::Vector3d x = far ? ray : Eigen::Vector3d(range_m * ray);
  const geometry::ProjectionWithJacobians at = projector.ProjectWithJacobians(x);
  rows.seen = at.status == Status::kOk;
  if (!rows.seen) return rows;
  Eigen::Matrix3d cross;
  cross << 0, -x.z(), x.y(), x.z(), 0, -x.x(), -x.y(), x.x(), 0;
  rows.motion.leftCols<3>() = -at.d_px_d_x * cross;
  rows.motion.rightCols<3>() = far ? Eigen::Matrix<double, 2, 3>::Zero() : at.d_px_d_x;
  rows.params = at.d_px_d_params;
  return rows;
}

/// (6, P) motion that makes up for a change of the parameters in the points in focus, least squares.
Eigen::MatrixXd ImpliedByParams(const geometry::Projector& projector, const std::vector<Ray>& rays,
                                const ProjectionDiffOptions& options, Eigen::Index num_params) {
  Eigen::Matrix<double, 6, 6> h = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::MatrixXd g = Eigen::MatrixXd::Zero(6, num_params);
  for (const double range : options.ranges_m) {
    for (const Ray& ray : rays) {
      const Rows rows = ray.in_focus ? RowsOf(projector, ray.direction, range) : Rows();
      if (!rows.seen) continue;
      h += rows.motion.transpose() * rows.motion;
      g += rows.motion.transpose() * rows.params;
    }
  }
  // Motions that show nowhere (translations of directions) stay zero: eigenvalues of the matrix with unit diagonal.
  const Eigen::Matrix<double, 6, 1> scale = h.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 0.0; });
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(scale.asDiagonal() * h * scale.asDiagonal());
  const Eigen::Matrix<double, 6, 1> inverse =
      eigen.eigenvalues().unaryExpr([](double value) { return value > 1e-12 ? 1 / value : 0.0; });
  return -(scale.asDiagonal() * (eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose()) *
           scale.asDiagonal() * g);
}

/// Mean square in px^2 that the errors of one lens cause at a range.
double MeanSquare(const RigCamera& camera, const std::vector<Ray>& rays, const Eigen::MatrixXd& implied, double range_m) {
  const geometry::Projector projector(camera.camera);
  double sum = 0;
  int count = 0;
  for (const Ray& ray : rays) {
    const Rows rows = RowsOf(projector, ray.direction, range_m);
    if (!rows.seen) continue;
    const Eigen::MatrixXd d_px = rows.params + rows.motion * implied;
    sum += (d_px * *camera.params_covariance * d_px.transpose()).trace();
    ++count;
  }
  return count > 0 ? sum / count : kNaN;
}

/// (6 N, 6 N) root of the covariance of all poses of a rig, its cameras in the order of `names`.
Eigen::MatrixXd PoseRoot(const Rig& rig, const std::vector<std::string>& names) {
  const geometry::StatedCovariance stated = geometry::StatedCovarianceOf(rig);
  const auto count = static_cast<Eigen::Index>(names.size());
  Eigen::MatrixXd poses(6 * count, 6 * count);
  for (Eigen::Index a = 0; a < count; ++a) {
    for (Eigen::Index b = 0; b < count; ++b) {
      const auto row = static_cast<size_t>(rig.Find(names[static_cast<size_t>(a)]));
      const auto col = static_cast<size_t>(rig.Find(names[static_cast<size_t>(b)]));
      poses.block<6, 6>(6 * a, 6 * b) = stated.joint.block<6, 6>(stated.PoseRow(row), stated.PoseRow(col));
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(poses);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
}

/// Lenses do not matter here, and a pinhole is compared fastest.
Rig Drawn(const Rig& reference, const Eigen::MatrixXd& root, Rng* random) {
  Eigen::VectorXd normal(root.cols());
  for (double& value : normal) value = random->Normal();
  const Eigen::VectorXd delta = root * normal;
  Rig drawn;
  for (size_t c = 0; c < reference.cameras.size(); ++c) {
    const RigCamera& camera = reference.cameras[c];
    RigCamera moved;
    moved.camera = geometry::MakePinhole(camera.camera.name, 2, 2, 1);
    moved.cam_from_world = geometry::Perturb(delta.segment<6>(6 * static_cast<Eigen::Index>(c)), camera.cam_from_world);
    drawn.cameras.push_back(moved);
  }
  return drawn;
}

bool KnowsPoses(const Rig& rig) {
  return std::all_of(rig.cameras.begin(), rig.cameras.end(),
                     [](const RigCamera& camera) { return camera.cam_from_world_covariance.has_value(); });
}

}  // namespace

std::vector<double> ExpectedProjectionRms(const RigCamera& camera, const RigCamera& reference,
                                          const ProjectionDiffOptions& options) {
  std::vector<double> expected(options.ranges_m.size(), kNaN);
  if (!camera.params_covariance || !reference.params_covariance) return expected;
  const std::vector<Ray> rays = Rays(reference.camera, options);
  std::vector<double> squares(expected.size(), 0);
  for (const RigCamera* lens : {&camera, &reference}) {
    const Eigen::Index num_params = lens->camera.params.size();
    const Eigen::MatrixXd implied = options.implied
                                        ? ImpliedByParams(geometry::Projector(lens->camera), rays, options, num_params)
                                        : Eigen::MatrixXd::Zero(6, num_params);
    for (size_t r = 0; r < squares.size(); ++r) squares[r] += MeanSquare(*lens, rays, implied, options.ranges_m[r]);
  }
  std::transform(squares.begin(), squares.end(), expected.begin(), [](double square) { return std::sqrt(square); });
  return expected;
}

std::vector<PoseDifference> PoseDifferences(const Rig& rig, const Rig& reference, const Rigid3& reference_from_rig) {
  std::vector<PoseDifference> differences;
  for (const RigCamera& camera : reference.cameras) {
    const int found = rig.Find(camera.camera.name);
    MVS_CHECK(found >= 0, "camera '" << camera.camera.name << "' of the reference is not in the rig");
    const RigCamera& other = rig.cameras[static_cast<size_t>(found)];
    const Rigid3 cam_from_reference = other.cam_from_world * geometry::Inverse(reference_from_rig);
    differences.push_back({cam_from_reference.rotation.angularDistance(camera.cam_from_world.rotation),
                           (geometry::Inverse(cam_from_reference).translation - camera.CenterInWorld()).norm()});
  }
  return differences;
}

std::vector<PoseDifference> ExpectedPoseDifferences(const Rig& rig, const Rig& reference, uint64_t seed) {
  std::vector<PoseDifference> unknown(reference.cameras.size(), {kNaN, kNaN});
  if (!KnowsPoses(rig) || !KnowsPoses(reference)) return unknown;
  const std::vector<std::string> names = geometry::CameraNames(reference);
  const Eigen::MatrixXd root = PoseRoot(rig, names), reference_root = PoseRoot(reference, names);
  Rng random(seed);
  std::vector<PoseDifference> squares(names.size());
  for (int sample = 0; sample < kNumSamples; ++sample) {
    const Rig a = Drawn(reference, root, &random), b = Drawn(reference, reference_root, &random);
    const geometry::RigDifference aligned = geometry::CompareRigs(a, b);
    if (aligned.status != Status::kOk) return unknown;
    const std::vector<PoseDifference> differences = PoseDifferences(a, b, aligned.reference_from_rig);
    for (size_t c = 0; c < squares.size(); ++c) {
      squares[c].rotation_rad += differences[c].rotation_rad * differences[c].rotation_rad / kNumSamples;
      squares[c].translation_m += differences[c].translation_m * differences[c].translation_m / kNumSamples;
    }
  }
  for (PoseDifference& square : squares) square = {std::sqrt(square.rotation_rad), std::sqrt(square.translation_m)};
  return squares;
}

}  // namespace mvstudio::calib
