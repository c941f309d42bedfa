#pragma once

#include <cstdint>

#include "dataset/pose/pose2d.h"
#include "geometry/rig/rig.h"
#include "geometry/skeleton/skeleton.h"
#include "synth/body_scene.h"

namespace mvstudio::synth {

/// Simulated keypoint detections: exact projections plus normal noise of `noise_px` per coordinate. Joints outside the
/// image, and face points on the far side of the head, are not detected (0, 0, 0). Other joints hidden behind more than
/// the flesh around them get a score of 0.4, visible ones 0.9.
dataset::Person2d DetectJoints(const BodyScene& scene, const geometry::RigCamera& camera, const geometry::Skeleton& skeleton,
                               const Eigen::Matrix3Xd& joints_in_world, double noise_px, uint64_t seed);

}  // namespace mvstudio::synth
