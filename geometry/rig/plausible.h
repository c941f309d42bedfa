#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/notice.h"
#include "geometry/rig/rig.h"

/// Checks for impossible or implausible calibrations, whatever file they came from.
namespace mvstudio::geometry {

/// Implausible properties of a calibration, at most one finding per kind; it lists the cameras concerned.
///   - CAL-DECENTRING: |p1| or |p2| above 0.05. Measured lenses stay below 0.01.
///   - CAL-TERMORDER: the distortion is plausible in another order of its terms (OtherTermOrders).
///   - CAL-FOLD: FoldsInside.
///   - CAL-CENTRE: the principal point is more than 30 % of a side outside the image. Crops usually stay within that.
///   - CAL-SIDES: the principal point is the middle of an image whose width and height are exchanged.
///   - CAL-FOCALSIZE: the focal length is below 0.15 or above 30 diagonals (147 and 2 degrees corner to corner; of a
///     wide lens below 0.05, px per radian). Or fx and fy differ by more than a fourth, as when width and height are
///     exchanged.
///   - CAL-INVERTED: the axes do not meet in front of the cameras, and do with every pose inverted.
///   - CAL-LOOKAWAY: the axes of three cameras or more meet behind all of them.
///   - CAL-DISTANCES: cameras are more than 100 m apart, or two closer than 5 mm, or three closer than 20 mm: the unit
///     may be wrong. The position of the world's origin does not matter. Or all stand at one place. Or the axes of three
///     or more meet within 30 mm; within 80 mm where the file's numbers were taken for centimetres (`in_centimetres`).
///
/// No finding makes a rig unusable: wide fields and exotic optics are real.
std::vector<Notice> ConflictsIn(const Rig& rig, bool in_centimetres = false);

/// |p1| and |p2| are at most 0.05 (CAL-DECENTRING).
bool HasLensDecentring(const Camera& camera);

/// A lens with its distortion terms in an order other than that of reading.
struct TermOrder {
  std::string name;  ///< "k1 k2 k3 p1 p2"
  Camera camera;
};

/// The same coefficients in the orders that other programs use, for perspective lenses with 4, 5, 8 terms and fisheyes
/// with 4. Empty for others.
std::vector<TermOrder> OtherTermOrders(const Camera& camera);

/// Fraction of the image, 0 … 1, whose pixels have no ray: beyond the radius where the lens folds, or outside its control
/// grid.
double ShareWithoutRay(const Camera& camera);

/// Whether the projection is not monotone in more than 2 % of the image. A wide lens may leave corners dark, so only its folds
/// less than 60 degrees off the axis count; splined lenses are exempt.
bool FoldsInside(const Camera& camera);
inline constexpr double kFoldSlack = 0.02;  ///< of the image: four folded corners are less

/// Why a file's rotation matrix is not a rotation (a reflection, not orthogonal, not finite); empty if it is one.
/// `tolerance` is on the Frobenius norm of M M^T - I.
std::string WhyNotARotation(const Eigen::Matrix3d& matrix, double tolerance = 2e-3);

}  // namespace mvstudio::geometry
