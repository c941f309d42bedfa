#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/keypoints/bundle.h"

namespace mvstudio::calib {

/// First columns of the cameras' unknowns in the equations; -1 for what is fixed.
struct KeypointLayout {
  std::vector<int> lens_column, pose_column;  ///< per camera: the first
  std::vector<Eigen::MatrixXd> directions;    ///< per camera (P, K)
  int total = 0;
};

KeypointLayout LayOut(const geometry::Rig& rig, const KeypointFreedom& freedom);

/// A solution and the second-order expansion of its cost as a function of the cameras alone, with every point at its
/// optimum. Kept per group of joints; each point's 3 x 3 block is eliminated. With f = sum of cauchy_px^2 / 2
/// KeypointCost: g = grad f, h = its second derivatives. These are of the cost itself, not of its weighted squares, which
/// are too large where views disagree. Second derivatives of the projection are neglected (Gauss-Newton).
struct KeypointProfile {
  geometry::Rig rig;
  double cauchy_px = 0;
  std::vector<KeypointFit> fits;
  std::vector<int> group_of_fit;
  KeypointLayout layout;
  std::vector<Eigen::MatrixXd> h;  ///< per group (n, n), symmetric
  std::vector<Eigen::VectorXd> g;  ///< per group (n)
  /// Basis (n, m) of the motions of the unknowns that change the rig's shape. All motions where some pose is fixed; else
  /// those that keep mean, rotation and scale of the camera centres. Scaled to unit diagonals of the equations before the
  /// points are eliminated.
  Eigen::MatrixXd motions;
};

/// `group_of_fit`: in [0, num_groups) for each fit, or -1 to exclude it. Excluded are also joints without a point, or
/// whose point is not a minimum in all directions. `fits` are those of `rig`; `cauchy_px` must be positive.
KeypointProfile ProfileOf(const geometry::Rig& rig, std::vector<KeypointFit> fits, std::vector<int> group_of_fit,
                          int num_groups, const KeypointFreedom& freedom, double cauchy_px, int num_threads);

/// Sum of the h of the groups that are not left out.
Eigen::MatrixXd CurvatureWithout(const KeypointProfile& profile, const std::vector<bool>& left_out);

/// Views whose residual is at most this many scales of the noise count as inliers: about three median lengths.
inline constexpr double kInlierScales = 5;

/// Curvature over other unknowns, all groups together. `of_inliers`: instead of the cost's own the normal equations J^T J of
/// the inliers, each with weight 1. They say what the views determine, whatever the residuals are: never negative.
Eigen::MatrixXd CurvatureUnder(const KeypointProfile& profile, const KeypointLayout& layout, bool of_inliers = false);

/// The solution without the groups of `left_out`: Newton steps with the second derivatives of the start, until the next
/// step would lower the cost by less than the fraction `tolerance`. Empty where the remaining groups do not determine the
/// cameras, or the first step does not lower the cost.
std::optional<geometry::Rig> SolveWithout(const KeypointProfile& profile, const std::vector<bool>& left_out,
                                          double tolerance = 1e-7);

/// The rig after a step of the unknowns.
geometry::Rig Moved(const geometry::Rig& rig, const KeypointLayout& layout, const Eigen::VectorXd& step);

}  // namespace mvstudio::calib
