#include "triangulate/point/linear.h"

#include <gtest/gtest.h>

#include "tests/triangulate/support.h"
#include "triangulate/point/refine.h"

namespace mvstudio::triangulate {
namespace {

std::vector<View> Views(const PreparedRig& rig, const std::vector<Observation>& observations) {
  Status rejected;
  return MakeViews(rig, observations, &rejected);
}

double SumOfSquaredDistances(const std::vector<View>& views, const Eigen::Vector3d& x) {
  double sum = 0;
  for (const View& view : views) sum += (x - view.camera->center_in_local).cross(view.ray_in_local).squaredNorm();
  return sum;
}

TEST(Linear, MidpointMinimizesItsOwnCost) {
  const geometry::Rig rig = MakeRing(5);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(3);
  for (int trial = 0; trial < 20; ++trial) {
    const std::vector<View> views = Views(prepared, Observe(rig, RandomPoint(&rng), 5, &rng));
    const LinearPoint point = Midpoint(views);
    ASSERT_EQ(point.status, Status::kOk);
    const double cost = SumOfSquaredDistances(views, point.x_in_local);
    for (int probe = 0; probe < 50; ++probe) {
      const Eigen::Vector3d away = 1e-4 * Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal());
      EXPECT_GT(SumOfSquaredDistances(views, point.x_in_local + away), cost);
    }
  }
}

TEST(Linear, WeightedIsNearTheMostLikelyPoint) {
  geometry::Rig rig = MakeRing(6);
  rig.cameras.push_back(LookAt("close", {0.5, 0.1, 0.9}, {0, 0, 0}));  // weights matter: it is three times nearer
  const PreparedRig prepared = Prepare(rig);
  Rng rng(7);
  double weighted = 0, plain = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const std::vector<View> views = Views(prepared, Observe(rig, RandomPoint(&rng, 0.2), 2, &rng));
    const LinearPoint linear = WeightedLinear(views);
    const Refinement best = Refine(views, linear.x_in_local);
    ASSERT_EQ(best.status, Status::kOk);
    weighted += (linear.x_in_local - best.x_in_local).norm();
    plain += (Midpoint(views).x_in_local - best.x_in_local).norm();
  }
  EXPECT_LT(weighted, 0.5 * plain);
}

TEST(Linear, ParallelRaysAreDegenerate) {
  geometry::Rig rig;
  for (const double y : {-1.0, 1.0}) rig.cameras.push_back(LookAt("c" + std::to_string(y), {0, y, 0}, {10, y, 0}));
  const PreparedRig prepared = Prepare(rig);
  const std::vector<View> views = Views(prepared, {{0, {639.5, 479.5}, 1, 1}, {1, {639.5, 479.5}, 1, 1}});
  EXPECT_EQ(Midpoint(views).status, Status::kDegenerate);
  EXPECT_EQ(WeightedLinear(views).status, Status::kDegenerate);
  EXPECT_EQ(Midpoint({views[0]}).status, Status::kTooFewViews);
  EXPECT_LT(ParallaxSignificance(views), 1e-9);
}

TEST(Refine, FindsTheMinimumOfTheWhitenedResiduals) {
  const geometry::Rig rig = MakeRing(5);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(9);
  for (int trial = 0; trial < 20; ++trial) {
    const std::vector<View> views = Views(prepared, Observe(rig, RandomPoint(&rng), 10, &rng, 10));
    const Refinement best = Refine(views, Midpoint(views).x_in_local);
    ASSERT_EQ(best.status, Status::kOk);
    const auto cost = [&views](const Eigen::Vector3d& x) { return Evaluate(views, x).chi_squared; };
    for (int k = 0; k < 3; ++k) {  // the gradient by central differences vanishes, its slope is the information's diagonal
      const double step = 1e-4;
      const Eigen::Vector3d h = step * Eigen::Vector3d::Unit(k);
      const double up = cost(best.x_in_local + h), down = cost(best.x_in_local - h);
      EXPECT_LT(std::abs(up - down) / (2 * step), 1e-3 * std::sqrt(best.information(k, k)));
      EXPECT_NEAR((up - 2 * best.chi_squared + down) / (2 * step * step) / best.information(k, k), 1, 0.05);
    }
  }
}

TEST(Refine, ConvergesFromFarAway) {
  const geometry::Rig rig = MakeRing(6);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(13);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Vector3d truth = RandomPoint(&rng, 0.4);
    const Refinement best = Refine(Views(prepared, Observe(rig, truth)), RandomPoint(&rng, 0.4) - prepared.origin_in_world);
    ASSERT_EQ(best.status, Status::kOk);
    EXPECT_LT((best.x_in_local + prepared.origin_in_world - truth).norm(), 1e-11);
  }
}

TEST(Refine, StartBehindACameraIsNamed) {
  const geometry::Rig rig = MakeRing(4);
  const PreparedRig prepared = Prepare(rig);
  EXPECT_EQ(Refine(Views(prepared, Observe(rig, {0, 0, 0})), {50, 0, 0}).status, Status::kBehindCamera);
}

}  // namespace
}  // namespace mvstudio::triangulate
