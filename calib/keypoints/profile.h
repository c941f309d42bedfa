#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/keypoints/bundle.h"

namespace mvstudio::calib {

/// Where the cameras' unknowns stand among the columns of their equations; -1 for what is fixed.
struct KeypointLayout {
  std::vector<int> lens_column, pose_column;  ///< per camera: the first
  std::vector<Eigen::MatrixXd> directions;    ///< per camera (P, K)
  int total = 0;
};

KeypointLayout LayOut(const geometry::Rig& rig, const KeypointFreedom& freedom);

/// A solution and its cost as a function of the cameras alone, every point at its best, to second order, in groups of joints:
/// each point's block of 3 x 3 is eliminated. With f = sum of cauchy_px^2 / 2 KeypointCost: g = grad f, h = its second
/// derivatives, those of the cost itself and not of its weighted squares, which are too large where views disagree. Second
/// derivatives of the projection are left out (Gauss-Newton).
struct KeypointProfile {
  geometry::Rig rig;
  double cauchy_px = 0;
  std::vector<KeypointFit> fits;
  std::vector<int> group_of_fit;
  KeypointLayout layout;
  std::vector<Eigen::MatrixXd> h;  ///< per group (n, n), symmetric
  std::vector<Eigen::VectorXd> g;  ///< per group (n)
  /// Basis (n, m) of the motions of the unknowns that change the rig's shape: all where some pose is fixed; else those that
  /// hold mean, turn and size of the camera centres. Scaled to unit diagonals of the equations before the points are
  /// eliminated.
  Eigen::MatrixXd motions;
};

/// `group_of_fit`: one of [0, num_groups) for each fit, or -1 to leave it out. Joints without a point, or whose point is not a
/// minimum in all directions, take no part. `fits` are those of `rig`; `cauchy_px` must be positive.
KeypointProfile ProfileOf(const geometry::Rig& rig, std::vector<KeypointFit> fits, std::vector<int> group_of_fit,
                          int num_groups, const KeypointFreedom& freedom, double cauchy_px, int num_threads);

/// Sum of the h of the groups that are not left out.
Eigen::MatrixXd CurvatureWithout(const KeypointProfile& profile, const std::vector<bool>& left_out);

/// The same over other unknowns, all groups together.
Eigen::MatrixXd CurvatureUnder(const KeypointProfile& profile, const KeypointLayout& layout);

/// The solution without the groups of `left_out`: Newton steps with the second derivatives of the start, until the next would
/// lower the cost by less than `tolerance` of it. Nothing where the rest does not determine the cameras, or the first step does
/// not lower the cost.
std::optional<geometry::Rig> SolveWithout(const KeypointProfile& profile, const std::vector<bool>& left_out,
                                          double tolerance = 1e-7);

/// The rig moved by a step of the unknowns.
geometry::Rig Moved(const geometry::Rig& rig, const KeypointLayout& layout, const Eigen::VectorXd& step);

}  // namespace mvstudio::calib
