#include "triangulate/budget/reliability.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

#include "core/check.h"
#include "core/statistics.h"
#include "core/units.h"
#include "geometry/rig/rig_covariance.h"
#include "triangulate/point/noise.h"

namespace mvstudio::triangulate {
namespace {

constexpr int kLevels = 19;

using geometry::Rigid3;
using geometry::Vector6d;

/// The perturbation of `reference` that makes it `transform`.
Vector6d PoseDifference(const Rigid3& transform, const Rigid3& reference) {
  Vector6d difference;
  difference << geometry::RotationLog(transform.rotation * reference.rotation.conjugate()),
      transform.translation - reference.translation;
  return difference;
}

/// Derivative of the pose of camera b relative to camera a, by their twelve perturbations (a first).
Eigen::Matrix<double, 6, 12> RelativeJacobian(const Rigid3& a_from_world, const Rigid3& b_from_world) {
  constexpr double kStep = 1e-6;
  const Rigid3 b_from_a = b_from_world * Inverse(a_from_world);
  const auto moved = [&](int k, double step) {
    Vector6d delta = Vector6d::Zero();
    delta[k % 6] = step;
    const Rigid3 a = k < 6 ? Perturb(delta, a_from_world) : a_from_world;
    const Rigid3 b = k < 6 ? b_from_world : Perturb(delta, b_from_world);
    return PoseDifference(b * Inverse(a), b_from_a);
  };
  Eigen::Matrix<double, 6, 12> jacobian;
  for (int k = 0; k < 12; ++k) jacobian.col(k) = (moved(k, kStep) - moved(k, -kStep)) / (2 * kStep);
  return jacobian;
}

/// Covariance of the poses of cameras 1 ... relative to camera 0.  // (6 (C - 1), 6 (C - 1))
Eigen::MatrixXd RelativeCovariance(const geometry::Rig& rig, const geometry::StatedCovariance& stated) {
  const size_t others = rig.cameras.size() - 1;
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(6 * static_cast<Eigen::Index>(others), stated.joint.rows());
  for (size_t c = 1; c <= others; ++c) {
    const auto own = RelativeJacobian(rig.cameras[0].cam_from_world, rig.cameras[c].cam_from_world);
    const Eigen::Index row = 6 * static_cast<Eigen::Index>(c - 1);
    jacobian.block<6, 6>(row, stated.PoseRow(0)) = own.leftCols<6>();
    jacobian.block<6, 6>(row, stated.PoseRow(c)) = own.rightCols<6>();
  }
  return jacobian * stated.joint * jacobian.transpose();
}

}  // namespace

double ChiSquaredProbability(double squared, int degrees_of_freedom) {
  MVS_CHECK(degrees_of_freedom == 1 || degrees_of_freedom == 3, degrees_of_freedom << " degrees of freedom");
  const double within = std::erf(std::sqrt(squared / 2));
  return degrees_of_freedom == 1 ? within : within - std::sqrt(2 * squared / kPi) * std::exp(-squared / 2);
}

Reliability MeasureReliability(const std::vector<double>& all, int degrees_of_freedom) {
  const std::vector<double> squared = FiniteValues(all);
  const double count = static_cast<double>(squared.size());
  Reliability result;
  result.num = static_cast<int>(squared.size());
  result.sigma_factor = std::sqrt(UpperMedian(squared) / ChiSquaredMedian(degrees_of_freedom));
  for (int k = 1; k <= kLevels; ++k) {
    const double stated = k / (kLevels + 1.0);
    double within = 0;
    for (const double value : squared) within += ChiSquaredProbability(value, degrees_of_freedom) <= stated;
    result.stated.push_back(stated);
    result.observed.push_back(within / count);
    result.error += std::abs(within / count - stated) / kLevels;
    result.chance += std::sqrt(2 / kPi * stated * (1 - stated) / count) / kLevels;
  }
  return result;
}

std::vector<double> WhitenedPoses(const geometry::Rig& rig, const geometry::Rig& truth) {
  const geometry::StatedCovariance stated = StatedCovarianceOf(rig);
  for (const bool known : stated.pose_known) {
    if (!known) return {};
  }
  if (rig.cameras.size() < 2) return {};
  Eigen::VectorXd errors(6 * static_cast<Eigen::Index>(rig.cameras.size() - 1));
  const auto relative = [](const geometry::Rig& of, size_t c) {
    return of.cameras[c].cam_from_world * Inverse(of.cameras[0].cam_from_world);
  };
  for (size_t c = 1; c < rig.cameras.size(); ++c)
    errors.segment<6>(6 * static_cast<Eigen::Index>(c - 1)) = PoseDifference(relative(rig, c), relative(truth, c));
  const Eigen::LLT<Eigen::MatrixXd> factor(RelativeCovariance(rig, stated));
  if (factor.info() != Eigen::Success) return {};
  const Eigen::VectorXd whitened = factor.matrixL().solve(errors);
  return {whitened.data(), whitened.data() + whitened.size()};
}

geometry::Rig RelativeToFirst(const geometry::Rig& rig) {
  geometry::StatedCovariance stated = StatedCovarianceOf(rig);
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Identity(stated.joint.rows(), stated.joint.rows());
  geometry::Rig relative = rig;
  const Rigid3 world_from_first = Inverse(rig.cameras.at(0).cam_from_world);
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    relative.cameras[c].cam_from_world = c == 0 ? Rigid3() : rig.cameras[c].cam_from_world * world_from_first;
    stated.pose_known[c] = stated.pose_known[c] && stated.pose_known[0];
    const Eigen::Index row = stated.PoseRow(c);
    if (c == 0) {
      jacobian.block<6, 6>(row, row).setZero();
      continue;
    }
    const auto own = RelativeJacobian(rig.cameras[0].cam_from_world, rig.cameras[c].cam_from_world);
    jacobian.block<6, 6>(row, stated.PoseRow(0)) = own.leftCols<6>();
    jacobian.block<6, 6>(row, row) = own.rightCols<6>();
  }
  stated.joint = Eigen::MatrixXd(jacobian * stated.joint * jacobian.transpose());
  stated.correlated = true;
  StoreCovariance(stated, &relative);
  return relative;
}

geometry::Rig DrawRig(const geometry::Rig& rig, Rng* rng) {
  const geometry::StatedCovariance stated = StatedCovarianceOf(rig);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(stated.joint);
  Eigen::VectorXd along(stated.joint.rows());
  for (Eigen::Index i = 0; i < along.size(); ++i) along[i] = rng->Normal() * std::sqrt(std::max(0.0, axes.eigenvalues()[i]));
  const Eigen::VectorXd delta = axes.eigenvectors() * along;
  geometry::Rig drawn = rig;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    geometry::RigCamera& camera = drawn.cameras[c];
    if (stated.lens_known[c]) camera.camera.params += delta.segment(stated.begin[c], camera.camera.params.size());
    if (stated.pose_known[c])
      camera.cam_from_world = Perturb(Vector6d(delta.segment<6>(stated.PoseRow(c))), camera.cam_from_world);
  }
  return drawn;
}

}  // namespace mvstudio::triangulate
