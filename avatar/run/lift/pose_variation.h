#pragma once

#include <Eigen/Core>
#include <array>

#include "core/random.h"
#include "dataset/pose/pose3d.h"

/// Random variations of a pose of Panoptic's 19 joints.
namespace mvstudio::avatar {

/// What changes a pose, by joint: each turns about its neighbour towards the body's centre, with all that hangs on it, and its
/// distance from there is multiplied.
struct PoseVariation {
  std::array<Eigen::Matrix3d, 19> turns;  ///< in world
  std::array<double, 19> lengths;
  PoseVariation() { turns.fill(Eigen::Matrix3d::Identity()), lengths.fill(1); }
};

/// Sets random turns; limbs turn by a standard deviation of `jitter_rad`, the head by half of it, rigid parts of trunk and head
/// by little or none.
void DrawTurns(double jitter_rad, Rng& rng, PoseVariation* variation);

/// Sets random lengths, the same left and right: the whole body's and each limb's own factor have logarithms of standard
/// deviation `spread`, cut at twice that.
void DrawLengths(double spread, Rng& rng, PoseVariation* variation);

/// The pose with its body's centre where it was. A missing joint is passed over; what hangs on it follows the next one.
dataset::Coco19Pose Varied(const dataset::Coco19Pose& pose, const PoseVariation& variation);

/// The mirror image across the plane x = 0, with left and right exchanged.
dataset::Coco19Pose Mirrored(const dataset::Coco19Pose& pose);

}  // namespace mvstudio::avatar
