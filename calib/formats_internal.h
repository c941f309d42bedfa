#pragma once

#include <Eigen/Geometry>
#include <string>
#include <string_view>

#include "geometry/camera.h"

/// Shared by the readers of formats.h; included by their .cc files only.
namespace mvstudio::calib::internal {

/// Where a value was read, for FormatError.
struct Place {
  std::string path, where;
};

/// A camera from a 3x3 matrix and a distortion vector in OpenCV's order; all-zero distortion becomes a pinhole. Throws
/// FormatError for skew, a matrix that is no camera matrix, a size out of range, or a number of coefficients that no lens model
/// has.
geometry::Camera MakeCamera(const std::string& name, double width_px, double height_px, const Eigen::Matrix3d& k,
                            const Eigen::VectorXd& distortion, bool fisheye, const Place& place);

/// Rotation from a matrix that a file calls one; throws FormatError when it is farther than 1e-3 from a rotation.
Eigen::Quaterniond MakeRotation(const Eigen::Matrix3d& matrix, const Place& place);

/// At most 40 characters of foreign text for a message, with '?' for whatever is not printable ASCII.
std::string Printable(std::string_view text);

/// The number `text` is, all of it; throws FormatError otherwise.
double ParseNumber(std::string_view text, const Place& place);

}  // namespace mvstudio::calib::internal
