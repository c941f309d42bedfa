#pragma once

#include <map>
#include <string>

#include "core/status.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rigid/rigid3.h"

/// The floor from people who walk on it.
namespace mvstudio::stages {

struct FeetFloor {
  Status status = Status::kOk;  ///< kTooFewViews, kDegenerate
  std::string message;          ///< one line when the status is not kOk
  /// z up, z = 0 on the floor. The origin is the point of the floor below (or above) the old one. x points as the old x axis
  /// does as far as the floor allows it (the old z axis, where x is nearly upright).
  geometry::Rigid3 floor_from_world;
  int num_places = 0, num_used = 0;              ///< where a joint of a foot stood still; those that lie on the floor
  double rms_m = 0;                              ///< heights of those over the plane of their joint
  double tilt_sigma_rad = 0;                     ///< of the floor's normal, in its least determined direction
  double rotated_rad = 0;                        ///< between the old z axis and the floor's normal
  std::map<std::string, double> joint_height_m;  ///< of standing "Ankle", "Heel", … above the floor
  std::string level;                             ///< what z = 0 was taken from
};

/// A joint of a foot stands where it stays within 4 cm for five frames or more, and for at least half as long as the median of
/// these places; each counts once. One plane for each kind of joint (ankles, heels, big toes, small toes), all parallel, is
/// fitted to the lower places (regression of the 0.3-quantile, Koenker and Bassett, Econometrica 46, 1978) and then, by least
/// squares, to those within 3 cm of it. People's legs say which side is up, and lean by less than 30 degrees on average.
///
/// z = 0 is the lowest plane of heels and toes; where there are none, it lies 0.039 of the stature below the ankles, and the
/// stature is the length of thigh and shank over 0.491 (Winter, Biomechanics and Motor Control of Human Movement, 2009).
///
/// The normal's standard deviation comes from a jackknife over the times when feet stood, and from a difference of 5 mm between
/// the joints of left and right feet. More than 2.5 degrees are refused: nobody walked, or along one line only.
FeetFloor FloorUnderFeet(const dataset::Pose3d& pose);

}  // namespace mvstudio::stages
