#include <gtest/gtest.h>

#include "dataset/pose/pose3d_compare.h"
#include "dataset/pose/pose3d_trc.h"
#include "tests/triangulate/recordings.h"
#include "triangulate/take/limbs.h"
#include "triangulate/take/take.h"

/// Real recordings of Pose2Sim's demo session against the .trc files that program wrote (a peer's output, not independent
/// truth).
namespace mvstudio::triangulate {
namespace {

struct Session : Recording {
  dataset::JointTable reference;
};

Session Load(const std::string& trial, const std::string& poses, const std::string& trc) {
  Session session{LoadPose2Sim(trial, poses), {}};
  const std::string path = testing::DataRoot() + "/pose2sim/" + trial + "/pose-3d/" + trc;
  session.reference = dataset::ToTable(dataset::ReadTrc(path).rows);
  return session;
}

dataset::Pose3dComparison Compare(const Session& session, const TakeOptions& options, TakeResult* take = nullptr) {
  const TakeResult result = TriangulateTake(session.rig, session.frames, 25, options);
  dataset::JointTable table;
  for (const TakePoint& entry : result.points) {
    if (entry.point.status != Status::kOk) continue;
    dataset::JointRow row;
    row.x_in_world = entry.point.x_in_world;
    table[entry.frame][entry.person][geometry::SkeletonByName("body25b").joints[entry.joint_idx]] = row;
  }
  if (take) *take = result;
  return dataset::ComparePose3d(table, session.reference);
}

class Pose2Sim : public ::testing::Test {
 protected:
  void SetUp() override { MVS_NEEDS_DATA("pose2sim"); }
  Session Balancing(const std::string& poses = "pose-associated") const {
    return Load("balancing", poses, "S00_P00_T01_BalancingTrial_0-100.trc");
  }
  Session Static() const { return Load("static", "pose-associated", "S00_P00_T00_StaticTrial_0-12.trc"); }
};

TEST_F(Pose2Sim, ExhaustiveDltReproducesItsPoints) {
  TakeOptions options;
  options.method.kind = TakeMethod::Kind::kExhaustiveDlt;
  const auto balancing = Compare(Balancing(), options);
  EXPECT_EQ(balancing.num, 2094);
  EXPECT_LT(balancing.max_mm, 1e-3);
  const auto still = Compare(Static(), options);
  EXPECT_EQ(still.num, 252);
  EXPECT_LT(still.max_mm, 1e-3);
}

std::vector<std::pair<int, int>> Limbs() {
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("body25b");
  std::vector<std::pair<int, int>> limbs;
  for (const auto& [a, b] : {std::pair("Shoulder", "Elbow"), {"Elbow", "Wrist"}, {"Hip", "Knee"}, {"Knee", "Ankle"}}) {
    for (const std::string side : {"L", "R"}) limbs.emplace_back(skeleton.Find(side + a), skeleton.Find(side + b));
  }
  return limbs;
}

TEST_F(Pose2Sim, DefaultBeatsItOnCamerasLeftOutAndOnLimbLengths) {
  TakeOptions peer_options;
  peer_options.method.kind = TakeMethod::Kind::kExhaustiveDlt;
  TakeResult ours, peer;
  Compare(Balancing(), {}, &ours);
  Compare(Balancing(), peer_options, &peer);
  EXPECT_NEAR(1000 * MeanLimbStd(MeasureLimbs(peer.points, Limbs())), 22.2, 0.05) << "the figure measured elsewhere";
  EXPECT_LT(1000 * MeanLimbStd(MeasureLimbs(ours.points, Limbs())), 22.2);
  const double gain_px = peer.holdout.all.median_px - ours.holdout.all.median_px;
  EXPECT_GT(gain_px, 2 * std::hypot(peer.holdout.all.median_error_px, ours.holdout.all.median_error_px));
  EXPECT_GE(ours.holdout.all.coverage, peer.holdout.all.coverage);
}

TEST_F(Pose2Sim, DefaultStaysWithinTenMillimetres) {
  const auto balancing = Compare(Balancing(), {});
  EXPECT_GE(balancing.num, 2090);
  EXPECT_LT(balancing.median_mm, 10);
  EXPECT_LT(Compare(Static(), {}).median_mm, 10);
}

TEST_F(Pose2Sim, PicksThePersonAmongPassersBy) {
  TakeResult take;
  const auto comparison = Compare(Balancing("pose"), {}, &take);
  EXPECT_EQ(take.num_persons, 1);
  EXPECT_GE(comparison.num, 2080);
  EXPECT_LT(comparison.median_mm, 10);
}

TEST_F(Pose2Sim, NamesTheCamerasThatAreOff) {
  TakeResult take;
  Compare(Balancing(), {}, &take);
  // Means over the views that Pose2Sim kept, measured with another program: (+8.9, +0.4), (-3.4, -2.6), (+8.5, +9.5), (+1.9,
  // -2.1).
  EXPECT_TRUE(take.cameras[0].off);
  EXPECT_TRUE(take.cameras[2].off);
  EXPECT_NEAR(take.cameras[0].mean_residual_px.x(), 8.9, 5);
  EXPECT_NEAR(take.cameras[2].mean_residual_px.x(), 8.5, 5);
  EXPECT_NEAR(take.cameras[2].mean_residual_px.y(), 9.5, 5);
  EXPECT_LT(take.cameras[1].mean_residual_px.norm(), take.cameras[2].mean_residual_px.norm());
}

}  // namespace
}  // namespace mvstudio::triangulate
