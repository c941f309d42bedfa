#include "stages/people/surface_scores.h"

#include <gmock/gmock.h>

namespace mvstudio::stages {
namespace {

using ::testing::HasSubstr;

body::BodyScore Frame(int frame, bool fitted, double to_m, double from_m) {
  body::BodyScore score;
  score.frame = frame, score.fitted = fitted;
  score.surface.to_truth = {to_m, 2 * to_m, 0.1};
  score.surface.from_truth = {from_m, 3 * from_m, 0.3};
  return score;
}

TEST(SurfaceScores, AreMeansOfEachSetOfFrames) {
  body::BodyScores scores;
  scores.mesh = "body";
  scores.frames = {Frame(0, true, 0.01, 0.02), Frame(1, true, 0.03, 0.02), Frame(2, false, 0.05, 0.07)};
  scores.frames[0].vertices = body::VertexError{Status::kOk, 0.04, 0.02};
  scores.frames[0].canonical_m = 0.01;
  CommandResult result;
  AddSurfaceScores("a/body.npz", scores, &result);
  EXPECT_EQ(result.exit, kExitOk);
  const auto& body = result.metrics["bodies"][0];
  EXPECT_EQ(body["mesh"], "body");
  EXPECT_EQ(body["fitted"]["frames"], 2);
  EXPECT_NEAR(body["fitted"]["to_truth_cm"].get<double>(), 2, 1e-9);
  EXPECT_NEAR(body["fitted"]["chamfer_cm"].get<double>(), 2, 1e-9);
  EXPECT_NEAR(body["fitted"]["mve_cm"].get<double>(), 4, 1e-9);
  EXPECT_NEAR(body["fitted"]["mve_procrustes_cm"].get<double>(), 2, 1e-9);
  EXPECT_NEAR(body["fitted"]["mve_canonical_cm"].get<double>(), 1, 1e-9);
  EXPECT_NEAR(body["other"]["chamfer_cm"].get<double>(), 6, 1e-9);
  EXPECT_NEAR(body["other"]["from_truth_p95_cm"].get<double>(), 21, 1e-9);
  EXPECT_NEAR(body["other"]["normal_deg"].get<double>(), 11.459, 1e-3);
  EXPECT_TRUE(body["other"]["mve_cm"].is_null());
  EXPECT_EQ(body["all"]["frames"], 3);
  EXPECT_THAT(result.text, HasSubstr("other"));
}

TEST(SurfaceScores, FramesWithoutAScoreAreCountedAndLeftOut) {
  body::BodyScores scores;
  scores.frames = {Frame(0, true, 0.01, 0.01), Frame(1, true, 9, 9)};
  scores.frames[1].surface.status = Status::kNonFiniteInput;
  CommandResult result;
  AddSurfaceScores("body.npz", scores, &result);
  EXPECT_EQ(result.exit, kExitPartial);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_THAT(result.warnings[0].text, HasSubstr("1 of 2"));
  EXPECT_NEAR(result.metrics["bodies"][0]["all"]["chamfer_cm"].get<double>(), 1, 1e-9);
}

TEST(SurfaceScores, WithoutASharedFrameThereIsNoScore) {
  CommandResult result;
  AddSurfaceScores("body.npz", {}, &result);
  EXPECT_EQ(result.exit, kExitBadInput);
  ASSERT_EQ(result.errors.size(), 1u);
  EXPECT_EQ(result.errors[0].code, "SUR-NO-FRAME");
}

}  // namespace
}  // namespace mvstudio::stages
