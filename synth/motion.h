#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "body/body_template.h"
#include "body/skeleton.h"
#include "calib/board/board.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::synth {

/// Pose of the board in frame `frame_idx` of `num_frames`: world_from_board. Frame 0: flat on the floor, printed side up,
/// corner 0 at the world's origin, rows along -y. Afterwards it is carried through the volume facing all directions, two
/// rotations in total, tilted between upright and 55 degrees up.
geometry::Rigid3 BoardPose(const calib::Board& board, int frame_idx, int num_frames, uint64_t seed);

/// Pose of the person at `time_s`: walks on the spot and about, turns, bends and waves. Sums of sinusoids with
/// incommensurable frequencies, so poses do not repeat. The lowest point of the body touches the floor.
body::BodyPose PersonPose(const body::BodyTemplate& body, double time_s, uint64_t seed);

/// Joints of `skeleton` (body25) in world, (3, J): the Panoptic joints plus toes and heels that follow the feet.
Eigen::Matrix3Xd PersonJoints(const body::BodyTemplate& body, const body::BodyPose& pose, const body::Skeleton& skeleton);

}  // namespace mvstudio::synth
