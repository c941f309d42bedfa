// Private: for the readers and writers of Panoptic's files.
#pragma once

#include <Eigen/Core>

namespace mvstudio::dataset::internal {

/// Converts a point from Panoptic's world (cm, y down) to ours (m, z up).
Eigen::Vector3d OursFromPanopticCm(double x, double y, double z);
/// The shortest decimal of centimetres that gives exactly `metres` when divided by 100: files survive a round trip
/// unchanged.
double Centimetres(double metres);

}  // namespace mvstudio::dataset::internal
