// Private: what a ProjectionUncertainty keeps, for projection_uncertainty*.cc.
#pragma once

#include <Eigen/Cholesky>
#include <vector>

#include "calib/bundle/rig_problem.h"
#include "calib/bundle/schur_lm.h"
#include "calib/covariance/projection_uncertainty.h"
#include "geometry/lens/camera.h"

namespace mvstudio::calib {
namespace internal {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// Cameras and frames that shared boards link. The mean motion of their boards is the twist (rotation, translation at `origin`)
///   twist = 1/F sum_b M_b delta_b,   M_b = [I 0; [t_b - origin]x I],   delta_b: perturbation of world_from_board, t_b its
///   place.
struct Component {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  int num_frames = 0;
  Eigen::MatrixXd by_global;      // (n, 6): minus the sum over its boards of W_b^T V_b^-1 M_b^T / F
  Matrix6 own = Matrix6::Zero();  // sum of M_b V_b^-1 M_b^T / F^2
};

/// Derivatives of `dim` numbers by the global unknowns and by the mean twist of a component.
struct Gradient {
  Status status = Status::kOk;
  int component = -1;
  Eigen::MatrixXd by_global;  // (n, dim)
  Eigen::MatrixXd by_twist;   // (6, dim)
};

}  // namespace internal

struct ProjectionUncertainty::Prepared {
  Status status = Status::kOk;
  RigState state;
  RigColumns columns;
  double sigma_px = 1;
  std::vector<Eigen::Index> estimated;   // (n) columns; the others were held
  Eigen::VectorXd scale;                 // (n) of the unit diagonal
  Eigen::LLT<Eigen::MatrixXd> factor;    // of the scaled reduced matrix of the estimated columns
  Eigen::MatrixXd carried;               // (columns.total, k) root of the covariance that held columns and omitted terms bring
  std::vector<int> component_of_camera;  // -1: no corners
  std::vector<internal::Component> components;
  std::vector<geometry::Projector> projectors;
  std::vector<double> range_m;          // per camera
  std::vector<Eigen::Vector3d> places;  // of boards, in world

  std::vector<int> LinkFrames(const std::vector<View>& views);
  void Fill(const std::vector<View>& views, const BundleOptions& options, const HeldCovariance& held);
  void Carry(const Eigen::MatrixXd& normal, const FreedProblem& freed);
  void CarryOmitted(const Eigen::VectorXd& gradient, const BundleOptions& options);
  Eigen::MatrixXd Whitened(const Eigen::MatrixXd& by_global) const;
  void AddBoards(const SchurSystem& system, const std::vector<int>& frames, const std::vector<int>& component_of_frame,
                 int gauge_frame);
  void NotePlaces(const std::vector<View>& views);

  internal::Gradient PointInImage(int camera_idx, const Eigen::Vector3d& x_in_cam, bool at_infinity) const;
  internal::Gradient OfPixel(int camera_idx, const Eigen::Vector2d& px, double range_m) const;
  internal::Gradient OfPoint(const Eigen::Vector3d& x_in_world, const std::vector<int>& cameras) const;
  std::vector<int> CamerasSeeing(const Eigen::Vector3d& x_in_world) const;
  std::vector<Eigen::MatrixXd> Covariances(const std::vector<const internal::Gradient*>& gradients) const;
  std::vector<Eigen::MatrixXd> CovariancesOfOne(const std::vector<const internal::Gradient*>& gradients) const;
  template <int N>
  std::vector<double> WorstSigmas(const std::vector<internal::Gradient>& gradients) const;
};

}  // namespace mvstudio::calib
