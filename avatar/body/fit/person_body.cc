#include "avatar/body/fit/person_body.h"

namespace mvstudio::body {

std::optional<ExpectedPose> ExpectByJoints(const PersonBody& person, const Eigen::Matrix3Xd& coco19_in_world,
                                           const std::array<bool, 19>& valid) {
  constexpr int kMaxIterations = 30;
  BodyPose start;
  if (!PoseFromJoints(person.body, coco19_in_world, valid, &start)) return std::nullopt;
  PoseProblemInput input;
  input.joints.x_in_world = coco19_in_world, input.joints.valid = valid;
  input.priors.push_back(AnatomicalPrior(person.body));
  input.joints.sigma_m.fill(person.joint_sigma_m);
  ArticulatedPose pose = SolvePose(person.body, input, FromBodyPose(person.body, start), kMaxIterations).pose;
  if (person.priors.bones.empty()) return ExpectedPose{pose, input.priors[0]};
  input.priors = {person.priors.Expect(person.body, pose)};
  pose.local_rotations = input.priors[0].mean;
  return ExpectedPose{SolvePose(person.body, input, pose, kMaxIterations).pose, input.priors[0]};
}

std::optional<ArticulatedPose> PoseByJoints(const PersonBody& person, const Eigen::Matrix3Xd& coco19_in_world,
                                            const std::array<bool, 19>& valid) {
  const auto found = ExpectByJoints(person, coco19_in_world, valid);
  return found ? std::optional(found->pose) : std::nullopt;
}

}  // namespace mvstudio::body
