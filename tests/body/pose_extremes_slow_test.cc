#include <cmath>
#include <limits>

#include "avatar/body/fit/person_body.h"
#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector3d;

Vector3d Deviates(Rng& rng) { return {rng.Normal(), rng.Normal(), rng.Normal()}; }

ArticulatedPose RandomPose(const BodyTemplate& body, double spread_rad, Rng& rng) {
  ArticulatedPose pose;
  for (size_t b = 0; b < body.bone_names.size(); ++b)
    pose.local_rotations.push_back(geometry::RotationExp(spread_rad * Deviates(rng)));
  pose.shift = Deviates(rng);
  return pose;
}

/// Joints of which some are those of a person, some are none, some are tiny, far, gone, or all in one place.
JointObservation RandomJoints(const BodyTemplate& body, int kind, Rng& rng) {
  JointObservation joints;
  joints.x_in_world = PosedCoco19(body, ToBodyPose(body, RandomPose(body, 0.5, rng)));
  joints.valid.fill(true), joints.sigma_m.fill(0.005);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (int j = 0; j < 19; ++j) {
    if (kind == 1) joints.x_in_world.col(j) = Deviates(rng);
    if (kind == 2) joints.valid[j] = rng.Uniform() > 0.3;
    if (kind == 2 && !joints.valid[j]) joints.x_in_world.col(j).setConstant(kNan);
    if (kind == 3) joints.x_in_world.col(j) = 1e-9 * Deviates(rng);
    if (kind == 4) joints.x_in_world.col(j) = joints.x_in_world.col(0) * (1 + 0.1 * j);
  }
  if (kind == 5) joints.x_in_world.array() += 1e6;
  if (kind == 6) joints.x_in_world *= rng.Uniform() < 0.5 ? 1e-3 : 1e3;
  return joints;
}

void ExpectSound(const ArticulatedPose& pose, int i) {
  ASSERT_TRUE(pose.shift.allFinite()) << i;
  for (const Eigen::Quaterniond& turn : pose.local_rotations) ASSERT_NEAR(turn.norm(), 1, 1e-9) << i;
}

TEST(PoseExtremes, TenThousandRandomStartsAreFiniteAndNeverWorse) {
  const BodyTemplate body = MakeMannequin(1.75, 0.6);
  const PersonBody person{body, 0.005, {}, {}};
  Rng rng(1);
  for (int i = 0; i < 10000; ++i) {
    const int kind = i % 7;
    PoseProblemInput input{RandomJoints(body, kind, rng), {AnatomicalPrior(body)}, {}};
    const auto by_joints = PoseByJoints(person, input.joints.x_in_world, input.joints.valid);
    if (by_joints) ExpectSound(*by_joints, i);
    const ArticulatedPose start = RandomPose(body, 2, rng);
    const PoseSolution at_start = SolvePose(body, input, start, 0), end = SolvePose(body, input, start, 10);
    ExpectSound(end.pose, i);
    if (std::isfinite(at_start.cost)) {
      ASSERT_LE(end.cost, at_start.cost) << i;
    }
  }
}

}  // namespace
}  // namespace mvstudio::body
