#pragma once

#include <array>
#include <map>
#include <optional>

#include "avatar/body/body_template.h"
#include "avatar/body/fit/rotation_prior.h"

namespace mvstudio::body {

/// A template fitted to one person: what poses it by joints alone, and the poses seen in images.
struct PersonBody {
  BodyTemplate body;             ///< lengths, joints and surface of the person, in the template's rest pose
  double joint_sigma_m = 0.005;  ///< of the joints that it was fitted to
  LearnedRotationPrior priors;
  std::map<int, ArticulatedPose> seen;  ///< by frame: poses by joints and images
};

/// A pose by joints alone, and what is expected of its bones.
struct ExpectedPose {
  ArticulatedPose pose;
  RotationPrior prior;
};

/// As below, with the learned prior's expectation (without a prior: that of people in general).
std::optional<ExpectedPose> ExpectByJoints(const PersonBody& person, const Eigen::Matrix3Xd& coco19_in_world,
                                           const std::array<bool, 19>& valid);

/// Pose for joints (3, 19) in world, metres. Empty when neck, shoulders and hips do not determine the trunk.
std::optional<ArticulatedPose> PoseByJoints(const PersonBody& person, const Eigen::Matrix3Xd& coco19_in_world,
                                            const std::array<bool, 19>& valid);

}  // namespace mvstudio::body
