#include <gtest/gtest.h>

#include <cstdio>

#include "tests/triangulate/recordings.h"
#include "triangulate/point/exhaustive_dlt.h"
#include "triangulate/point/holdout.h"
#include "triangulate/take/take.h"

/// Which method predicts a real camera best from the others.
namespace mvstudio::triangulate {
namespace {

PointSolver SolverOf(const PreparedRig& rig, PointMethod method) {
  return [&rig, method](const std::vector<Observation>& seen) {
    PointOptions options;
    options.method = method;
    return TriangulatePoint(rig, seen, options);
  };
}

TEST(LeaveOneCameraOut, MethodsOnBalancing) {
  MVS_NEEDS_DATA("pose2sim");
  const Recording recording = LoadPose2Sim("balancing");
  const TakeResult take = TriangulateTake(recording.rig, recording.frames, 25, {});
  const PreparedRig rig = Prepare(recording.rig);
  std::vector<PointLabel> labels;
  for (const TakePoint& point : take.points) labels.push_back({point.frame, point.person, point.joint_idx});
  const auto dlt = [&recording](const std::vector<Observation>& seen) { return TriangulateExhaustiveDlt(recording.rig, seen); };
  const std::vector<MethodCandidate> candidates{{"robust", 4, SolverOf(rig, PointMethod::kRobust)},
                                                {"all-views", 3, SolverOf(rig, PointMethod::kAllViews)},
                                                {"linear", 2, SolverOf(rig, PointMethod::kLinear)},
                                                {"midpoint", 1, SolverOf(rig, PointMethod::kMidpoint)},
                                                {"exhaustive-dlt", 5, dlt}};
  const MethodChoice choice = ChooseMethod(rig, take.observations, labels, candidates, {}, 2);
  for (const MethodScore& score : choice.scores) {
    std::printf("%-15s median %.3f +- %.3f px, p90 %.2f, coverage %.4f, from best %+.3f +- %.3f, p90 %+.2f +- %.2f %s\n",
                score.name.c_str(), score.figures.median_px, score.figures.median_error_px, score.figures.p90_px,
                score.figures.coverage, score.from_best.median_px, score.from_best.median_error_px, score.from_best.p90_px,
                score.from_best.p90_error_px, score.justified ? "justified" : "");
  }
  std::printf("%s\n", choice.reason.c_str());
  EXPECT_EQ(choice.status, Status::kOk);
  EXPECT_NE(choice.scores[choice.chosen].name, "exhaustive-dlt");
  EXPECT_LE(choice.scores[choice.chosen].figures.median_px, choice.scores[4].figures.median_px);
}

}  // namespace
}  // namespace mvstudio::triangulate
