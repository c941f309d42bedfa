#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "avatar/body/body_template.h"
#include "calib/board/board.h"
#include "geometry/rigid/rigid3.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::synth {

/// Pose of the board in frame `frame_idx` of `num_frames`: world_from_board. Frame 0: flat on the floor, printed side up,
/// corner 0 at the world's origin, rows along -y. Afterwards it is carried through the volume facing all directions, two
/// rotations in total, tilted between upright and 55 degrees up.
geometry::Rigid3 BoardPose(const calib::Board& board, int frame_idx, int num_frames, uint64_t seed);

/// Pose of the person at `time_s`: walks on the spot and about, turns, bends and waves. Sums of sinusoids with
/// incommensurable frequencies, so poses do not repeat. The lowest point of the body touches the floor. The roles of the body's
/// bones must be complete (avatar/body/role_bones.h); bones of role kOther keep their rest pose.
body::BodyPose PersonPose(const body::BodyTemplate& body, double time_s, uint64_t seed);

/// Once around on the spot in `duration_s`, counter-clockwise from facing -y, arms 45 degrees off the body. As a real person
/// who turns: small steps, arms and trunk within about 4 degrees of the A-pose. The lowest point touches the floor.
body::BodyPose TurnPose(const body::BodyTemplate& body, double time_s, double duration_s, uint64_t seed);

/// Joints of `skeleton` (body25) in world, (3, J): the Panoptic joints plus toes and heels that follow the feet, in a person's
/// usual proportions.
Eigen::Matrix3Xd PersonJoints(const body::BodyTemplate& body, const body::BodyPose& pose, const geometry::Skeleton& skeleton);

}  // namespace mvstudio::synth
