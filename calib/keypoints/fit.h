#pragma once

#include <utility>
#include <vector>

#include "calib/keypoints/take.h"

namespace mvstudio::calib {

/// A joint and its point from all of its views.
struct KeypointFit {
  const KeypointJoint* joint = nullptr;
  bool ok = false;  ///< false: no point, or one that a camera does not see in front of it
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector2d> residuals_px;  // per entry of joint->seen: observed minus projected; infinite when not ok
  double cost = 0;                            ///< sum over the views of KeypointCost
  std::vector<Eigen::Vector3d> others = {};   ///< other local minima, which may become the smallest when cameras move
                                              ///< slightly
};

/// Cost of a residual: log(1 + |r|^2 / c^2), the tail of a Cauchy distribution of scale c, because detectors mostly err by
/// a few px and sometimes by a limb. With c = 0 the squared length.
double KeypointCost(const Eigen::Vector2d& residual_px, double cauchy_px);

/// Points of all joints with at least `min_views` views: the minimum of the cost over all views. The search starts at the
/// least-squares point and, for up to 6 views, at that of every pair of views (with c > 0 there are several minima).
std::vector<KeypointFit> FitKeypoints(const geometry::Rig& rig, const std::vector<KeypointJoint>& joints, double cauchy_px,
                                      int min_views, int num_threads);

/// Same for cameras that have moved slightly since `fits` were made: the smallest of the minima known then.
std::vector<KeypointFit> RefitKeypoints(const geometry::Rig& rig, const std::vector<KeypointFit>& fits, double cauchy_px,
                                        int num_threads);

/// Scale c of the noise: sqrt(3) c is the median length of a bivariate Cauchy variable. Residuals of n views are
/// multiplied by sqrt(2 n / (2 n - 3)), because the point was fitted to them. Of two views, both residuals together
/// give one length, which has one degree of freedom: the cost likes to fit one view exactly, and a median over single views
/// would shrink with every round. NaN without residuals.
double CauchyScale(const std::vector<KeypointFit>& fits);

/// Error of a rig on joints: statistics of the lengths of all residuals of all joints.
struct KeypointError {
  double median_px = 0, mean_px = 0, p90_px = 0;
  double limb_std_mm = 0;   ///< standard deviation of a limb's length over the frames, mean over the limbs
  double limb_mean_mm = 0;  ///< mean length, mean over the limbs: reveals a rig that shrinks people
  int num_joints = 0;       ///< joints with a point
  int num_failed = 0;       ///< joints without a point; not in the figures above
};

/// `limbs` are pairs of joints; a limb's length needs both in one frame. NaN where there is nothing to count.
KeypointError ErrorOf(const std::vector<KeypointFit>& fits, const std::vector<std::pair<int, int>>& limbs);

}  // namespace mvstudio::calib
