#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdio>

#include "core/format.h"
#include "dataset/pose/pose3d_compare.h"
#include "geometry/skeleton/skeleton.h"
#include "tests/triangulate/recordings.h"
#include "triangulate/skeleton/refine.h"

/// Recorded people: the refined joints predict cameras that were left out better, and bones keep their lengths.
namespace mvstudio::triangulate {
namespace {

/// Upper arms, forearms, thighs and shanks.
std::vector<std::pair<int, int>> Limbs(const geometry::Skeleton& skeleton) {
  std::vector<std::pair<int, int>> limbs;
  for (const char* side : {"L", "R"}) {
    for (const auto& [a, b] : std::vector<std::pair<std::string, std::string>>{
             {"Shoulder", "Elbow"}, {"Elbow", "Wrist"}, {"Hip", "Knee"}, {"Knee", "Ankle"}}) {
      limbs.emplace_back(skeleton.Find(side + a), skeleton.Find(side + b));
    }
  }
  return limbs;
}

void Print(const SkeletonRefineReport& report) {
  for (const TermTrial& t : report.trials) {
    std::printf("  %-13s %-6.3g median %.3f -> %.3f px (%+.3f +- %.3f), p90 %+.3f +- %.3f, coverage %.3f -> %.3f %s%s\n",
                t.name.c_str(), t.weight, t.before.median_px, t.after.median_px, t.difference.median_px,
                t.difference.median_error_px, t.difference.p90_px, t.difference.p90_error_px, t.before.coverage,
                t.after.coverage, t.better ? "better" : "", t.chosen ? " CHOSEN" : "");
  }
  std::printf("  held-out median %.3f -> %.3f px, sigmas %.2f -> %.2f, limb std %.1f -> %.1f mm, %d filled\n",
              report.before.median_px, report.after.median_px, report.before.median_sigmas, report.after.median_sigmas,
              report.limb_std_before_mm, report.limb_std_after_mm, report.num_filled);
}

SkeletonRefineResult Refine(const Recording& recording, const std::vector<std::pair<int, int>>& bones, const char* what) {
  const PreparedRig rig = Prepare(recording.rig);
  const TakeResult take = TriangulateTake(recording.rig, recording.frames, 25, {});
  const auto start = std::chrono::steady_clock::now();
  const auto solve = [&rig](const std::vector<Observation>& seen) { return TriangulatePoint(rig, seen); };
  SkeletonRefineResult result = RefineSkeleton(rig, take, bones, solve, {});
  std::printf("%s: %.1f s\n", what, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  Print(result.report);
  return result;
}

/// The calibration bends bones by centimetres: held-out cameras allow smoothness and refuse constant lengths.
TEST(SkeletonRefine, Balancing) {
  MVS_NEEDS_DATA("pose2sim");
  const auto refined = Refine(LoadPose2Sim("balancing"), Limbs(geometry::SkeletonByName("body25b")), "balancing");
  const SkeletonRefineReport& report = refined.report;
  EXPECT_GT(report.smoothness, 0);
  EXPECT_EQ(report.bone_lengths, 0);
  EXPECT_LT(report.after.median_px, report.before.median_px - 0.2);
  EXPECT_GE(report.after.coverage, report.before.coverage);
  EXPECT_LE(report.after.median_sigmas, report.before.median_sigmas + 0.01);
  EXPECT_LT(report.limb_std_after_mm, report.limb_std_before_mm);
  EXPECT_LT(report.limb_std_after_mm, 22.2);  // Pose2Sim's
}

dataset::Pose3dComparison CompareWithTruth(const std::vector<TakePoint>& points) {
  dataset::Pose3d pose{"body25", {}};
  for (const TakePoint& entry : points) {
    dataset::JointRow row;
    row.frame = entry.frame, row.person = entry.person,
    row.joint = geometry::SkeletonByName("body25").joints[static_cast<size_t>(entry.joint_idx)];
    row.status = entry.point.status;
    if (row.status == Status::kOk) row.x_in_world = entry.point.x_in_world, row.covariance = entry.point.covariance;
    pose.rows.push_back(row);
  }
  std::map<int, std::map<int, dataset::Coco19Pose>> truth;
  for (int f = 0; f < 120; ++f) {
    truth[f] =
        dataset::ReadBody3dScene(testing::DataRoot() + Format("/person_a/hdPose3d_stage1_coco19/body3DScene_%08d.json", f));
  }
  return dataset::ComparePose3d(dataset::ToCoco19Table(pose), dataset::ToTable(truth));
}

/// Five of the cameras, exactly calibrated: both terms are on and the true error falls.
TEST(SkeletonRefine, PersonAgainstTruth) {
  MVS_NEEDS_DATA("person_a");
  Recording recording = LoadPersonA();
  recording.rig.cameras.resize(5);
  for (DetectedFrame& frame : recording.frames) frame.people.resize(5);
  const TakeResult take = TriangulateTake(recording.rig, recording.frames, 25, {});
  const auto refined = Refine(recording, geometry::SkeletonByName("body25").bones, "person_a");
  const auto before = CompareWithTruth(take.points), after = CompareWithTruth(refined.points);
  std::printf("  error median %.2f -> %.2f mm, p95 %.2f -> %.2f mm, joints %d -> %d, coverage %.3f %.3f\n", before.median_mm,
              after.median_mm, before.p95_mm, after.p95_mm, before.num, after.num, after.coverage68, after.coverage95);
  EXPECT_GT(refined.report.bone_lengths, 0);
  EXPECT_LT(after.median_mm, 0.9 * before.median_mm);
  EXPECT_LT(refined.report.limb_std_after_mm, 0.5 * refined.report.limb_std_before_mm);
  EXPECT_GT(after.coverage68, 0.6);
  EXPECT_GT(after.coverage95, 0.88);
}

}  // namespace
}  // namespace mvstudio::triangulate
