#include "calib/rig/rotation_averaging.h"

#include <cmath>

#include "core/error.h"
#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

Eigen::Vector3d RandomTurn(Rng* rng, double limit) {
  return {rng->Uniform(-limit, limit), rng->Uniform(-limit, limit), rng->Uniform(-limit, limit)};
}

/// Four links of five between 12 nodes are right, the others random; the rotations come out as if only the right ones were
/// there.
TEST(RotationAveraging, OutlierLinksDoNotMatter) {
  Rng rng(3);
  std::vector<Rigid3> truth;
  for (int n = 0; n < 12; ++n) truth.push_back({geometry::RotationExp(RandomTurn(&rng, 1.5)), RandomTurn(&rng, 3)});
  const Rigid3 gauge = geometry::Inverse(truth[0]);
  for (Rigid3& pose : truth) pose = pose * gauge;
  std::vector<PoseLink> links;
  for (int a = 0; a < 12; ++a) {
    for (int b = a + 1; b < 12; ++b) {
      PoseLink link{a, b, truth[a] * geometry::Inverse(truth[b]), RandomTurn(&rng, 1), rng.Uniform(1, 5)};
      if ((a + b) % 5 == 2) link.a_from_b = {geometry::RotationExp(RandomTurn(&rng, 1.5)), RandomTurn(&rng, 3)};
      links.push_back(link);
    }
  }
  std::vector<Rigid3> poses = ChainPoses(12, links);
  AverageRotations(links, {}, &poses);
  AverageTranslations(links, {}, &poses);
  for (int n = 0; n < 12; ++n) {
    EXPECT_LT(geometry::RotationAngle(poses[n].rotation, truth[n].rotation), 1e-5);
    EXPECT_LT((poses[n].translation - truth[n].translation).norm(), 1e-4);
  }
}

/// A circle of equal rotations about one axis whose sum misses by 60 mrad: least squares gives every link the same share.
TEST(RotationAveraging, TheErrorOfALoopIsShared) {
  constexpr int kNodes = 12;
  std::vector<PoseLink> links;
  for (int n = 0; n < kNodes; ++n) {
    const Eigen::Vector3d turn(0, 0, 2 * M_PI / kNodes + (n + 1 == kNodes ? 0.06 : 0));
    links.push_back({(n + 1) % kNodes, n, {geometry::RotationExp(turn), Eigen::Vector3d::Zero()}, Eigen::Vector3d::Zero(), 1});
  }
  std::vector<Rigid3> poses = ChainPoses(kNodes, links);
  AverageRotations(links, {}, &poses);
  for (const PoseLink& link : links) {
    const Eigen::Quaterniond is = poses[link.a].rotation * poses[link.b].rotation.conjugate();
    EXPECT_NEAR(geometry::RotationAngle(is, link.a_from_b.rotation), 0.06 / kNodes, 1e-9);
  }
}

TEST(RotationAveraging, GroupsAndBadLinks) {
  const std::vector<PoseLink> links = {{4, 1, {}, Eigen::Vector3d::Zero(), 1}, {1, 3, {}, Eigen::Vector3d::Zero(), 1}};
  EXPECT_EQ(LinkedGroups(5, links), (std::vector<std::vector<int>>{{1, 3, 4}, {0}, {2}}));
  KnownPoses known(5);
  known[0] = known[2] = Rigid3();
  EXPECT_EQ(LinkedGroups(5, links, known), (std::vector<std::vector<int>>{{1, 3, 4}, {0, 2}}));
  EXPECT_THROW(LinkedGroups(4, links), ContractViolation);
  EXPECT_THROW(LinkedGroups(5, {{1, 1, {}, Eigen::Vector3d::Zero(), 1}}), ContractViolation);
  EXPECT_THROW(LinkedGroups(5, {{1, 2, {}, Eigen::Vector3d::Zero(), 0}}), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::calib
