#pragma once

#include <vector>

#include "avatar/body/fit/pose_solver.h"
#include "avatar/body/fit/posed_bones.h"

namespace mvstudio::body {

/// How one person's bones turn beyond what joints show (hands, feet, the bend of the trunk): linear in the rotations of the
/// bone and its neighbours, and in the direction of up. Ridge regression, a bone at a time; its strength, or the mean alone, or
/// nothing, by cross validation over contiguous blocks of time steps.
struct LearnedRotationPrior {
  struct Bone {
    Eigen::Matrix3Xd weights;  ///< (3, features); empty: as the joints say
    double sigma_rad = 0;      ///< rms of what was predicted for time steps left out
  };
  std::vector<Bone> bones;  ///< (B); empty: too few time steps were seen

  /// What a bone's learned prior depends on.
  static Eigen::Index NumFeatures(const BodyTemplate& body, int bone);

  /// `by_joints` and `seen` are poses of the same time steps in order of time: by joints alone, and by images too.
  static LearnedRotationPrior Learn(const BodyTemplate& body, const std::vector<ArticulatedPose>& by_joints,
                                    const std::vector<ArticulatedPose>& seen);

  /// Expected local rotations for a pose by joints alone, each within its sigma.
  RotationPrior Expect(const BodyTemplate& body, const ArticulatedPose& by_joints) const;
};

}  // namespace mvstudio::body
