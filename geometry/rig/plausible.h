#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "geometry/rig/rig.h"

/// Calibrations that cannot be true, or hardly: looked at once, whatever file they came from.
namespace mvstudio::geometry {

/// One line about a rig: a stable code, what is doubtful of which cameras, and what to do.
struct RigDoubt {
  std::string code, text, hint;
};

/// What is doubtful of a calibration, at most one doubt a kind; the cameras that share it are listed in it.
/// - CAL-DECENTRING: |p1| or |p2| above 0.05. Measured lenses stay below 0.01.
/// - CAL-TERMORDER: the distortion makes sense in another order of its terms (OtherTermOrders).
/// - CAL-FOLD: the projection is not monotone within the image. A wide lens may leave corners dark, so of it only folds
///   less than 60 degrees off the axis count; a splined one is never meant.
/// - CAL-CENTRE: the principal point is more than 30 % of a side outside the image. Crops stay within that as a rule.
/// - CAL-FOCALSIZE: the focal length is below 0.15 or above 30 diagonals (147 and 2 degrees corner to corner; of a wide lens
/// below
///   0.05, px a radian), or fx and fy differ by more than a fourth, as when width and height are exchanged.
/// - CAL-DISTANCES: cameras stand more than 100 m apart, or two closer than 5 mm, three closer than 20 mm: the unit may be
///   another. Where the world's origin lies does not matter.
/// Nothing here makes a rig unusable: wide fields and exotic optics are real.
std::vector<RigDoubt> DoubtsAbout(const Rig& rig);

/// A lens whose distortion terms stood in another order in the file than it was read in.
struct TermOrder {
  std::string name;  ///< "k1 k2 k3 p1 p2"
  Camera camera;
};

/// The same numbers in the orders that other programs use; of perspective lenses with 4, 5, 8 terms and fisheyes with 4. Empty
/// for others.
std::vector<TermOrder> OtherTermOrders(const Camera& camera);

/// Part of the image, 0 … 1, whose pixels have no ray: beyond the radius where the lens folds, or outside its control grid.
double ShareWithoutRay(const Camera& camera);

/// Why a matrix that a file calls a rotation is none (a reflection, not orthogonal, not finite), or nothing. `tolerance` is on
/// the Frobenius norm of M M^T - I.
std::string WhyNotARotation(const Eigen::Matrix3d& matrix, double tolerance = 2e-3);

}  // namespace mvstudio::geometry
