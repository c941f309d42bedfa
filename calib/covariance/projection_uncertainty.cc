#include "calib/covariance/projection_uncertainty.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/covariance/projection_uncertainty_prepared.h"
#include "core/check.h"
#include "core/statistics.h"
#include "geometry/lens/lens_derivatives.h"
#include "geometry/rigid/cross_matrix.h"

namespace mvstudio::calib {
namespace {

using Eigen::Index;
using internal::Component;
using internal::Gradient;
using Matrix23 = Eigen::Matrix<double, 2, 3>;
using Matrix26 = Eigen::Matrix<double, 2, 6>;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kParallel = 1e-12;  // smallest over largest eigenvalue of a triangulation's normal equations

/// The larger of the two where both are numbers, else the one that is.
double Larger(double a, double b) { return std::isnan(a) ? b : std::isnan(b) ? a : std::max(a, b); }

template <int N>
double WorstSigma(const Eigen::Matrix<double, N, N>& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, N, N>> eigen(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, eigen.eigenvalues()[N - 1]));
}

Gradient NoGradient(Status status) {
  Gradient gradient;
  gradient.status = status;
  return gradient;
}

}  // namespace

double PixelUncertainty::worst_px() const { return status == Status::kOk ? WorstSigma<2>(covariance_px2) : kNan; }
double PointUncertainty::worst_m() const { return status == Status::kOk ? WorstSigma<3>(covariance_m2) : kNan; }

/// Derivatives of the pixel of a point, or of a direction, that moves with the boards.
Gradient ProjectionUncertainty::Prepared::PointInImage(int camera_idx, const Eigen::Vector3d& x_in_cam,
                                                       bool at_infinity) const {
  const geometry::Projection projection = projectors[camera_idx].Project(x_in_cam);
  if (projection.status != Status::kOk) return NoGradient(projection.status);
  Gradient gradient;
  gradient.component = component_of_camera[camera_idx];
  if (gradient.component < 0 || components[gradient.component].num_frames == 0) return NoGradient(Status::kTooFewViews);
  geometry::LensDerivatives d;
  Eigen::Vector2d px;
  const geometry::Camera& camera = state.cameras[camera_idx];
  if (!geometry::ProjectLens(camera, x_in_cam, &px, &d)) return NoGradient(Status::kOutsideValidRadius);
  gradient.by_global.setZero(columns.total, 2);
  const int lens = columns.lens[camera_idx], first = columns.first_param[camera_idx], pose = columns.camera[camera_idx];
  for (int k = 0; lens >= 0 && k < d.count; ++k) {
    if (d.columns[k] >= first) gradient.by_global.row(lens + d.columns[k] - first) = d.d_px.col(k).transpose();
  }
  const geometry::Rigid3& cam_from_world = state.cam_from_world[camera_idx];
  const Eigen::Vector3d rotated = at_infinity ? x_in_cam : Eigen::Vector3d(x_in_cam - cam_from_world.translation);
  const Matrix23& by_cam = d.d_px_d_x_in_cam;
  if (pose >= 0) gradient.by_global.middleRows<3>(pose) = -(by_cam * geometry::CrossMatrix(rotated)).transpose();
  if (pose >= 0 && !at_infinity) gradient.by_global.middleRows<3>(pose + 3) = by_cam.transpose();
  const Matrix23 by_world = by_cam * cam_from_world.rotation.toRotationMatrix();
  Eigen::Vector3d arm = cam_from_world.rotation.conjugate() * rotated;
  if (!at_infinity) arm -= components[gradient.component].origin;
  Matrix26 by_twist = Matrix26::Zero();
  by_twist.leftCols<3>() = -by_world * geometry::CrossMatrix(arm);
  if (!at_infinity) by_twist.rightCols<3>() = by_world;
  gradient.by_twist = by_twist.transpose();
  return gradient;
}

Gradient ProjectionUncertainty::Prepared::OfPixel(int camera_idx, const Eigen::Vector2d& px, double range) const {
  MVS_CHECK(camera_idx >= 0 && camera_idx < static_cast<int>(state.cameras.size()), "camera " << camera_idx);
  MVS_CHECK(range > 0, "range " << range << " m");
  if (status != Status::kOk) return NoGradient(status);
  const geometry::Unprojection ray = projectors[camera_idx].Unproject(px);
  if (ray.status != Status::kOk) return NoGradient(ray.status);
  const bool at_infinity = std::isinf(range);
  return PointInImage(camera_idx, (at_infinity ? 1 : range) * ray.ray_in_cam, at_infinity);
}

/// Triangulation moves by -(sum P^T P)^-1 sum P^T dq, P the derivative of a pixel by the point; the boards' motion is in dq.
Gradient ProjectionUncertainty::Prepared::OfPoint(const Eigen::Vector3d& x_in_world, const std::vector<int>& cameras) const {
  if (status != Status::kOk) return NoGradient(status);
  if (cameras.size() < 2) return NoGradient(Status::kTooFewViews);
  Gradient sum;
  sum.by_global.setZero(columns.total, 3), sum.by_twist.setZero(6, 3);
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  for (int c : cameras) {
    MVS_CHECK(c >= 0 && c < static_cast<int>(state.cameras.size()), "camera " << c);
    const Gradient one = PointInImage(c, state.cam_from_world[c] * x_in_world, false);
    if (one.status != Status::kOk) return one;
    if (sum.component >= 0 && sum.component != one.component) return NoGradient(Status::kDegenerate);
    sum.component = one.component;
    const Matrix23 p = one.by_twist.bottomRows<3>().transpose();
    normal += p.transpose() * p;
    sum.by_global -= one.by_global * p;
    sum.by_twist -= one.by_twist * p;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(normal);
  if (!(eigen.eigenvalues()[0] > kParallel * eigen.eigenvalues()[2])) return NoGradient(Status::kLowParallax);
  const Eigen::Matrix3d inverse =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose();
  sum.by_global *= inverse, sum.by_twist *= inverse;
  return sum;
}

std::vector<int> ProjectionUncertainty::Prepared::CamerasSeeing(const Eigen::Vector3d& x_in_world) const {
  std::vector<int> seeing;
  for (size_t c = 0; c < projectors.size(); ++c) {
    const geometry::Projection at = projectors[c].Project(state.cam_from_world[c] * x_in_world);
    if (component_of_camera[c] >= 0 && at.status == Status::kOk && geometry::InImage(state.cameras[c], at.px))
      seeing.push_back(static_cast<int>(c));
  }
  return seeing;
}

/// Columns whose inner products are the covariances of the given ones, in units of sigma_px^2.
Eigen::MatrixXd ProjectionUncertainty::Prepared::Whitened(const Eigen::MatrixXd& by_global) const {
  const Index n = static_cast<Index>(estimated.size());
  Eigen::MatrixXd white(n + carried.cols(), by_global.cols());
  Eigen::MatrixXd own = scale.asDiagonal() * by_global(estimated, Eigen::all);
  if (n > 0) factor.matrixL().solveInPlace(own);
  white.topRows(n) = own;
  if (carried.cols() > 0) white.bottomRows(carried.cols()) = carried.transpose() * by_global / sigma_px;
  return white;
}

/// v^T H^-1 v with the boards eliminated: (v_g - sum W^T V^-1 v_b)^T S^-1 (…) + sum v_b^T V^-1 v_b. All gradients are of one
/// component. With few unknowns in play their joint covariance comes first, else every gradient is solved for.
std::vector<Eigen::MatrixXd> ProjectionUncertainty::Prepared::CovariancesOfOne(
    const std::vector<const Gradient*>& gradients) const {
  const Component& component = components[gradients.front()->component];
  Index total = 0;
  Eigen::Array<bool, Eigen::Dynamic, 1> in_play = Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(columns.total, false);
  for (const Gradient* gradient : gradients) {
    total += gradient->by_global.cols();
    in_play = in_play || (gradient->by_global.array() != 0).rowwise().any();
  }
  std::vector<Index> rows;
  for (Index i = 0; i < in_play.size(); ++i) {
    if (in_play[i]) rows.push_back(i);
  }
  const Index active = static_cast<Index>(rows.size());
  const bool joint_first = active + 6 < total;
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(columns.total, joint_first ? active + 6 : total);
  if (joint_first) {
    for (Index k = 0; k < active; ++k) right(rows[k], k) = 1;
    right.rightCols<6>() = component.by_global;
  } else {
    Index at = 0;
    for (const Gradient* g : gradients) {
      right.middleCols(at, g->by_global.cols()) = g->by_global + component.by_global * g->by_twist;
      at += g->by_global.cols();
    }
  }
  right = Whitened(right);
  const Eigen::MatrixXd joint = joint_first ? Eigen::MatrixXd(right.transpose() * right) : Eigen::MatrixXd();
  std::vector<Eigen::MatrixXd> result;
  Index at = 0;
  for (const Gradient* g : gradients) {
    const Index dim = g->by_global.cols();
    Eigen::MatrixXd covariance = g->by_twist.transpose() * component.own * g->by_twist;
    if (joint_first) {
      Eigen::MatrixXd z(active + 6, dim);
      z.topRows(active) = g->by_global(rows, Eigen::all);
      z.bottomRows<6>() = g->by_twist;
      covariance += z.transpose() * joint * z;
    } else {
      covariance += right.middleCols(at, dim).transpose() * right.middleCols(at, dim);
    }
    result.push_back(sigma_px * sigma_px * covariance);
    at += dim;
  }
  return result;
}

std::vector<Eigen::MatrixXd> ProjectionUncertainty::Prepared::Covariances(const std::vector<const Gradient*>& gradients) const {
  std::vector<Eigen::MatrixXd> result(gradients.size());
  for (int c = 0; c < static_cast<int>(components.size()); ++c) {
    std::vector<const Gradient*> of_component;
    std::vector<size_t> indices;
    for (size_t i = 0; i < gradients.size(); ++i) {
      if (gradients[i]->status == Status::kOk && gradients[i]->component == c)
        of_component.push_back(gradients[i]), indices.push_back(i);
    }
    if (indices.empty()) continue;
    const std::vector<Eigen::MatrixXd> found = CovariancesOfOne(of_component);
    for (size_t k = 0; k < indices.size(); ++k) result[indices[k]] = found[k];
  }
  return result;
}

/// NaN for gradients without a value.
template <int N>
std::vector<double> ProjectionUncertainty::Prepared::WorstSigmas(const std::vector<Gradient>& gradients) const {
  std::vector<const Gradient*> pointers;
  for (const Gradient& gradient : gradients) pointers.push_back(&gradient);
  const std::vector<Eigen::MatrixXd> covariances = Covariances(pointers);
  std::vector<double> sigmas;
  for (const Eigen::MatrixXd& covariance : covariances)
    sigmas.push_back(covariance.size() ? WorstSigma<N>(Eigen::Matrix<double, N, N>(covariance)) : kNan);
  return sigmas;
}

ProjectionUncertainty::ProjectionUncertainty(const std::vector<View>& views, const RigState& state,
                                             const BundleOptions& options, double sigma_px, const HeldCovariance& held) {
  MVS_CHECK(state.world_from_board.size() >= state.frames.size(), "frames without a board");
  auto prepared = std::make_shared<Prepared>();
  prepared->state = state;
  prepared->sigma_px = held.any() ? std::max(sigma_px, 1e-9) : sigma_px;  // held errors are counted in units of it
  prepared->Fill(views, options, held);
  prepared_ = std::move(prepared);
}

Status ProjectionUncertainty::status() const { return prepared_->status; }

PixelUncertainty ProjectionUncertainty::PixelCovariance(int camera_idx, const Eigen::Vector2d& px, double range_m) const {
  const Gradient gradient = prepared_->OfPixel(camera_idx, px, range_m);
  if (gradient.status != Status::kOk) return {gradient.status, Eigen::Matrix2d::Zero()};
  return {Status::kOk, prepared_->Covariances({&gradient})[0]};
}

Eigen::MatrixXd ProjectionUncertainty::UncertaintyMap(int camera_idx, int cols, int rows, double range_m) const {
  MVS_CHECK(cols >= 2 && rows >= 2, "a map of " << cols << " x " << rows);
  std::vector<Gradient> gradients;
  for (int row = 0; row < rows; ++row) {
    for (int col = 0; col < cols; ++col) {
      const geometry::Camera& camera = prepared_->state.cameras[camera_idx];
      const Eigen::Vector2d px(col * (camera.width_px - 1.0) / (cols - 1), row * (camera.height_px - 1.0) / (rows - 1));
      gradients.push_back(prepared_->OfPixel(camera_idx, px, range_m));
    }
  }
  const std::vector<double> sigmas = prepared_->WorstSigmas<2>(gradients);
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(sigmas.data(), rows, cols);
}

PointUncertainty ProjectionUncertainty::PointCovariance(const Eigen::Vector3d& x_in_world, std::vector<int> cameras) const {
  if (cameras.empty()) cameras = prepared_->CamerasSeeing(x_in_world);
  const Gradient gradient = prepared_->OfPoint(x_in_world, cameras);
  if (gradient.status != Status::kOk) return {gradient.status, Eigen::Matrix3d::Zero()};
  return {Status::kOk, prepared_->Covariances({&gradient})[0]};
}

std::vector<double> ProjectionUncertainty::VolumeUncertainty(int max_points) const {
  MVS_CHECK(max_points > 0, "at most " << max_points << " points");
  const size_t num = prepared_->places.size(), used = std::min<size_t>(num, static_cast<size_t>(max_points));
  std::vector<Gradient> gradients;
  for (size_t i = 0; i < used; ++i) {
    const Eigen::Vector3d& x_in_world = prepared_->places[i * num / used];
    gradients.push_back(prepared_->OfPoint(x_in_world, prepared_->CamerasSeeing(x_in_world)));
  }
  std::vector<double> sigmas = prepared_->WorstSigmas<3>(gradients);
  sigmas.erase(std::remove_if(sigmas.begin(), sigmas.end(), [](double s) { return std::isnan(s); }), sigmas.end());
  std::sort(sigmas.begin(), sigmas.end());
  return sigmas;
}

UncertaintySummary ProjectionUncertainty::Summarize() const {
  constexpr double kFar = 0.95;
  UncertaintySummary summary{kNan, kNan, kNan, kNan, kNan, {}};
  for (int c = 0; c < static_cast<int>(prepared_->state.cameras.size()); ++c) {
    const geometry::Camera& camera = prepared_->state.cameras[c];
    CameraUncertainty one{camera.name, prepared_->range_m[c], kNan, kNan, kNan};
    std::vector<Gradient> gradients;
    std::vector<double*> kinds;
    for (int i = -1; i <= 1 && one.range_m > 0; ++i) {
      for (int j = -1; j <= 1; ++j) {
        const Eigen::Vector2d middle(0.5 * (camera.width_px - 1), 0.5 * (camera.height_px - 1));
        const Eigen::Vector2d px = middle + kFar * Eigen::Vector2d(i, j).cwiseProduct(middle);
        gradients.push_back(prepared_->OfPixel(c, px, one.range_m));
        kinds.push_back(i == 0 && j == 0 ? &one.centre_px : i == 0 || j == 0 ? &one.edge_px : &one.corner_px);
      }
    }
    const std::vector<double> sigmas = prepared_->WorstSigmas<2>(gradients);
    for (size_t i = 0; i < sigmas.size(); ++i) *kinds[i] = Larger(*kinds[i], sigmas[i]);
    summary.centre_px = Larger(summary.centre_px, one.centre_px);
    summary.edge_px = Larger(summary.edge_px, one.edge_px);
    summary.corner_px = Larger(summary.corner_px, one.corner_px);
    summary.cameras.push_back(one);
  }
  const std::vector<double> volume = VolumeUncertainty();
  if (!volume.empty()) summary.volume_mm = 1e3 * UpperMedian(volume), summary.volume_max_mm = 1e3 * volume.back();
  return summary;
}

}  // namespace mvstudio::calib
