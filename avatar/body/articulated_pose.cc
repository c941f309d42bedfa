#include "avatar/body/articulated_pose.h"

namespace mvstudio::body {

BodyPose ToBodyPose(const BodyTemplate& body, const ArticulatedPose& pose) {
  return PoseFromAngles(body, {Eigen::Quaterniond::Identity(), pose.shift}, pose.local_rotations);
}

}  // namespace mvstudio::body
