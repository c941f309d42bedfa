#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdio>

#include "body/skeleton.h"
#include "tests/triangulate/recordings.h"
#include "triangulate/skeleton_refine.h"

/// Recorded people: the refined joints predict cameras that were left out better, and bones keep their lengths.
namespace mvstudio::triangulate {
namespace {

/// Upper arms, forearms, thighs and shanks.
std::vector<std::pair<int, int>> Limbs(const body::Skeleton& skeleton) {
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

TEST(SkeletonRefine, Balancing) {
  MVS_NEEDS_DATA("pose2sim");
  const auto& skeleton = body::SkeletonByName("body25b");
  Refine(LoadPose2Sim("balancing"), Limbs(skeleton), "limbs only");
  Refine(LoadPose2Sim("balancing"), skeleton.bones, "all bones");
}

TEST(SkeletonRefine, PersonA) {
  MVS_NEEDS_DATA("person_a");
  const auto& skeleton = body::SkeletonByName("body25");
  Refine(LoadPersonA(), skeleton.bones, "person_a");
}

}  // namespace
}  // namespace mvstudio::triangulate
