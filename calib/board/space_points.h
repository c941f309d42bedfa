#pragma once

#include <Eigen/Core>
#include <optional>

#include "geometry/rigid/rigid3.h"

/// Views of points that do not lie in a plane: one of them determines pose and lens.
namespace mvstudio::calib {

/// Whether the points (3, N) lie off a plane, by a thirtieth of their extent or more, and are six or more. `weights` (N):
/// those that count; empty: all.
bool SpansSpace(const Eigen::Matrix3Xd& points, const Eigen::VectorXd& weights = {});

/// A pinhole camera as a 3 x 4 matrix: rays ~ matrix * (x, 1). Direct linear transformation with normalised coordinates
/// (Hartley and Zisserman, "Multiple View Geometry", 2nd ed. 2004, algorithm 7.1), of rays (3, N) of any direction. Empty
/// where the points do not determine it: fewer than six, or in a plane.
std::optional<Eigen::Matrix<double, 3, 4>> FitProjection(const Eigen::Matrix3Xd& points, const Eigen::Matrix3Xd& rays);

/// Pose of points in space in a camera that is known, from rays (3, N) of theirs. Empty as above.
std::optional<geometry::Rigid3> PoseInSpace(const Eigen::Matrix3Xd& points, const Eigen::Matrix3Xd& rays);

/// Focal length (px) of a camera that sees points (3, N) in space at px (2, N). Empty as above, and where no camera looks like
/// that.
std::optional<double> FocalInSpace(const Eigen::Matrix3Xd& points, const Eigen::Matrix2Xd& px, int width_px, int height_px);

}  // namespace mvstudio::calib
