#pragma once

#include <Eigen/Core>
#include <vector>

#include "avatar/body/body_template.h"

namespace mvstudio::synth {

/// Muscles and tips of bones that swell as elbows and knees bend: what linear blend skinning does not know. A vertex moves
/// along its rest normal n by sum_i a_i (1 - cos(angle_i)) w_i(x), where the angle is that between the directions of the two
/// bones of the joint, less that at rest, w_i is a bell along the bone and a cosine lobe around it, and a_i the swelling at a
/// right angle.
class Muscles {
 public:
  /// The roles of the bones must be complete (avatar/body/role_bones.h).
  explicit Muscles(const body::BodyTemplate& body);

  /// Displacement at rest, before skinning. (3, V) metres in body; zero at the rest pose, to the last bit.
  Eigen::Matrix3Xf Swelling(const body::BodyPose& pose) const;

 private:
  struct Muscle {
    int bone, child;                // the joint between them
    Eigen::Vector3d rest_in_child;  // unit direction of the child at rest, in body
    std::vector<int> vertices;
    Eigen::Matrix3Xf full;  // (3, vertices) displacement at a right angle
  };
  std::vector<Muscle> muscles_;
  Eigen::Index num_vertices_ = 0;
};

}  // namespace mvstudio::synth
