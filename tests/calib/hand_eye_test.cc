#include "calib/rig/hand_eye.h"

#include <cmath>
#include <limits>

#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

Rigid3 RandomPose(Rng* rng, double angle, double length) {
  const Eigen::Vector3d turn(rng->Normal(), rng->Normal(), rng->Normal()), shift(rng->Normal(), rng->Normal(), rng->Normal());
  return {geometry::RotationExp(angle * turn), length * shift};
}

struct HandEyeScene {
  Rigid3 a_from_b, q_from_p;
  std::vector<HandEyePair> pairs;
};

/// Body p 1 m in front of a; `axis`: the only one about which the boards turn, zero for all.
HandEyeScene MakeHandEyeScene(int num_pairs, uint64_t seed, double rotation_noise, double translation_noise,
                              const Eigen::Vector3d& axis = Eigen::Vector3d::Zero()) {
  Rng rng(seed);
  HandEyeScene scene{RandomPose(&rng, 1, 1), RandomPose(&rng, 0.7, 0.5), {}};
  for (int i = 0; i < num_pairs; ++i) {
    Rigid3 a_from_p = RandomPose(&rng, 0.4, 0.2);
    if (!axis.isZero()) a_from_p.rotation = geometry::RotationExp(rng.Normal() * axis);
    a_from_p.translation.z() += 1;
    const Rigid3 b_from_q = geometry::Inverse(scene.a_from_b) * a_from_p * geometry::Inverse(scene.q_from_p);
    const auto noisy = [&](const Rigid3& pose) {
      const Rigid3 noise = RandomPose(&rng, 1, 1);
      geometry::Vector6d delta;
      delta << rotation_noise * geometry::RotationLog(noise.rotation), translation_noise * noise.translation;
      return geometry::Perturb(delta, pose);
    };
    scene.pairs.push_back({noisy(a_from_p), noisy(b_from_q)});
  }
  return scene;
}

TEST(HandEye, NoiseFreeToRounding) {
  for (int n : {3, 4, 30}) {
    for (uint64_t seed = 1; seed <= 5; ++seed) {
      const HandEyeScene scene = MakeHandEyeScene(n, seed, 0, 0);
      const HandEye found = SolveHandEye(scene.pairs);
      ASSERT_EQ(found.status, Status::kOk) << found.message;
      EXPECT_LT(geometry::RotationAngle(found.a_from_b.rotation, scene.a_from_b.rotation), 1e-12);
      EXPECT_LT((found.a_from_b.translation - scene.a_from_b.translation).norm(), 1e-11);
      EXPECT_LT(geometry::RotationAngle(found.q_from_p.rotation, scene.q_from_p.rotation), 1e-12);
      EXPECT_LT((found.q_from_p.translation - scene.q_from_p.translation).norm(), 1e-11);
      EXPECT_EQ(found.num_inliers, n);
    }
  }
}

/// Squared error over predicted variance, averaged over seeds and coordinates, is 1 when the prediction is right.
TEST(HandEye, ErrorsAreAsPredicted) {
  constexpr int kSeeds = 60;
  double rotation = 0, translation = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const HandEyeScene scene = MakeHandEyeScene(40, seed, 0.003, 0.003);
    const HandEye found = SolveHandEye(scene.pairs);
    ASSERT_EQ(found.status, Status::kOk) << found.message;
    const Eigen::Vector3d turn = geometry::RotationLog(found.a_from_b.rotation * scene.a_from_b.rotation.conjugate());
    const Eigen::Vector3d shift = found.a_from_b.translation - scene.a_from_b.translation;
    rotation += turn.cwiseQuotient(found.a_from_b_sigma.head<3>()).squaredNorm() / (3 * kSeeds);
    translation += shift.cwiseQuotient(found.a_from_b_sigma.tail<3>()).squaredNorm() / (3 * kSeeds);
  }
  EXPECT_GT(rotation, 0.5);
  EXPECT_LT(rotation, 1.8);
  EXPECT_GT(translation, 0.5);
  EXPECT_LT(translation, 1.8);
}

TEST(HandEye, WrongPosesDoNotMatter) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    HandEyeScene scene = MakeHandEyeScene(40, seed, 1e-3, 1e-3);
    Rng rng(seed + 50);
    for (size_t i = 0; i < scene.pairs.size(); i += 4) scene.pairs[i].b_from_q = RandomPose(&rng, 1, 1);
    const HandEye found = SolveHandEye(scene.pairs);
    ASSERT_EQ(found.status, Status::kOk) << found.message;
    EXPECT_EQ(found.num_inliers, 30);
    for (int k = 0; k < 3; ++k) {
      EXPECT_LT(std::abs((found.a_from_b.translation - scene.a_from_b.translation)[k]), 4.5 * found.a_from_b_sigma[3 + k]);
    }
    EXPECT_LT(geometry::RotationAngle(found.a_from_b.rotation, scene.a_from_b.rotation),
              4.5 * found.a_from_b_sigma.head<3>().norm());
  }
}

TEST(HandEye, TurnsAboutOneAxisAreRefused) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, -1).normalized();
  for (double noise : {0.0, 1e-4, 3e-3, 2e-2}) {
    for (uint64_t seed = 1; seed <= 10; ++seed) {
      const HandEye found = SolveHandEye(MakeHandEyeScene(25, seed, noise, noise, axis).pairs);
      EXPECT_EQ(found.status, Status::kDegenerate)
          << "noise " << noise << " seed " << seed << " sigma " << found.a_from_b_sigma.transpose();
      EXPECT_FALSE(found.message.empty());
    }
  }
}

TEST(HandEye, NoTurnsAtAllAreRefused) {
  HandEyeScene scene = MakeHandEyeScene(10, 3, 0, 0);
  for (HandEyePair& pair : scene.pairs) {
    pair.a_from_p.rotation = scene.pairs[0].a_from_p.rotation;
    pair.b_from_q = geometry::Inverse(scene.a_from_b) * pair.a_from_p * geometry::Inverse(scene.q_from_p);
  }
  EXPECT_EQ(SolveHandEye(scene.pairs).status, Status::kDegenerate);
}

TEST(HandEye, TooFewAndNotFinite) {
  HandEyeScene scene = MakeHandEyeScene(3, 1, 0, 0);
  scene.pairs.pop_back();
  EXPECT_EQ(SolveHandEye(scene.pairs).status, Status::kTooFewViews);
  EXPECT_EQ(SolveHandEye({}).status, Status::kTooFewViews);
  scene = MakeHandEyeScene(5, 1, 0, 0);
  scene.pairs[2].a_from_p.translation.y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(SolveHandEye(scene.pairs).status, Status::kNonFiniteInput);
}

TEST(HandEye, OrderOfTheDevicesIsAMatterOfNames) {
  const HandEyeScene scene = MakeHandEyeScene(12, 7, 2e-4, 2e-4);
  std::vector<HandEyePair> swapped;
  for (const HandEyePair& pair : scene.pairs) swapped.push_back({pair.b_from_q, pair.a_from_p});
  const HandEye there = SolveHandEye(scene.pairs), back = SolveHandEye(swapped);
  ASSERT_EQ(there.status, Status::kOk);
  ASSERT_EQ(back.status, Status::kOk);
  const Rigid3 loop = there.a_from_b * back.a_from_b;
  EXPECT_LT(geometry::RotationLog(loop.rotation).norm(), 2 * there.a_from_b_sigma.head<3>().norm());
  EXPECT_LT(loop.translation.norm(), 2 * there.a_from_b_sigma.tail<3>().norm());
}

}  // namespace
}  // namespace mvstudio::calib
