#include <cmath>

#include "core/error.h"
#include "core/random.h"
#include "stages/surface/describe.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

body::BodyScore Frame(int frame, bool fitted, double to_m, double from_m) {
  body::BodyScore score;
  score.frame = frame, score.fitted = fitted;
  score.surface.to_truth = {to_m, 2 * to_m, 0.1};
  score.surface.from_truth = {from_m, 3 * from_m, 0.3};
  return score;
}

CommandResult Said(const std::string& path, const body::BodyScores& scores) {
  SurfaceReport report;
  report.options.bodies = {path}, report.options.truth = "truth", report.scores = {scores};
  return Describe(report);
}

TEST(SurfaceScores, AreMeansOfEachSetOfFrames) {
  body::BodyScores scores;
  scores.mesh = "body";
  scores.frames = {Frame(0, true, 0.01, 0.02), Frame(1, true, 0.03, 0.02), Frame(2, false, 0.05, 0.07)};
  scores.frames[0].vertices = body::VertexError{Status::kOk, 0.04, 0.02};
  scores.frames[0].canonical_m = 0.01;
  const CommandResult result = Said("a/body.npz", scores);
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

/// Distances twice as large as normal ones of the stated sigma: the closed form of the calibration error is 0.21.
TEST(SurfaceScores, SigmasThatAreTooSmallByTwoAreSaid) {
  Rng rng(4);
  body::BodyScores scores;
  scores.frames = {Frame(0, true, 0.01, 0.02)};
  EXPECT_FALSE(Said("body.npz", scores).metrics["bodies"][0].contains("reliability"));
  for (int i = 0; i < 20000; ++i) scores.whitened.push_back(std::pow(2 * rng.Normal(), 2));
  const CommandResult result = Said("body.npz", scores);
  const auto& reliability = result.metrics["bodies"][0]["reliability"];
  EXPECT_EQ(reliability["num"], 20000);
  EXPECT_NEAR(reliability["expected_calibration_error"].get<double>(), 0.21, 0.01);
  EXPECT_NEAR(reliability["sigma_factor"].get<double>(), 2, 0.04);
  EXPECT_THAT(result.text, HasSubstr("should grow by"));
}

TEST(SurfaceScores, FramesWithoutAScoreAreCountedAndLeftOut) {
  body::BodyScores scores;
  scores.frames = {Frame(0, true, 0.01, 0.01), Frame(1, true, 9, 9)};
  scores.frames[1].surface.status = Status::kNonFiniteInput;
  const CommandResult result = Said("body.npz", scores);
  EXPECT_EQ(result.exit, kExitPartial);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_THAT(result.warnings[0].text, HasSubstr("1 of 2"));
  EXPECT_NEAR(result.metrics["bodies"][0]["all"]["chamfer_cm"].get<double>(), 1, 1e-9);
}

TEST(SurfaceScores, WithoutASharedFrameThereIsNoScore) {
  const CommandResult result = Said("body.npz", {});
  EXPECT_EQ(result.exit, kExitBadInput);
  ASSERT_EQ(result.errors.size(), 1u);
  EXPECT_EQ(result.errors[0].code, "SUR-NO-FRAME");
}

TEST(SurfaceScores, ABodyWithoutFramesCountsMoreThanOneWithSome) {
  SurfaceReport report;
  report.options.bodies = {"a.npz", "b.npz"}, report.options.truth = "truth";
  report.scores.resize(2);
  report.scores[1].frames = {Frame(0, true, 9, 9)};
  report.scores[1].frames[0].surface.status = Status::kNonFiniteInput;
  const CommandResult result = Describe(report);
  EXPECT_EQ(result.exit, kExitBadInput) << "a has no frame; b is partial";
  ASSERT_EQ(result.metrics["bodies"].size(), 2u);
  EXPECT_EQ(result.metrics["bodies"][1]["body"], "b.npz");
  EXPECT_THAT(result.inputs, ::testing::ElementsAre("a.npz", "b.npz", "truth"));
  EXPECT_THAT(result.text, HasSubstr("chamfer")) << "the table has a head";
}

TEST(SurfaceScores, AMissingTruthIsNamed) {
  SurfaceOptions options;
  options.truth = "/nowhere/truth";
  EXPECT_THROW(RunSurface(options), IoError);
}

}  // namespace
}  // namespace mvstudio::stages
