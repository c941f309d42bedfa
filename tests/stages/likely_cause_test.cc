#include "stages/people/likely_cause.h"

#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

using triangulate::Cause;

triangulate::CauseReport Report() {
  triangulate::CauseReport report;
  report.as_given.assumption = "as given", report.as_given.carried = 0.01, report.as_given.residual_px = 25;
  triangulate::CauseTrial exchanged, mirrored;
  exchanged.cause = Cause::kExchanged, exchanged.assumption = "with cameras a and b exchanged";
  exchanged.remedy = "exchange the names", exchanged.carried = 0.875, exchanged.residual_px = 1.5, exchanged.clear = true;
  mirrored.cause = Cause::kMirrored, mirrored.assumption = "with camera c mirrored", mirrored.residual_px = 24;
  report.trials = {exchanged, mirrored};
  return report;
}

CauseFinding Said(const CauseFinding& finding, CommandResult* said) {
  said->Add(finding.said);
  return finding;
}

TEST(LikelyCause, AClearCauseIsToldAndItsRemedyReturned) {
  triangulate::CauseReport report = Report();
  report.message = "with cameras a and b exchanged 88 % fit";
  CommandResult result;
  EXPECT_EQ(Said(CauseOfLoss(report, "TRI-CAUSE", "look at it"), &result).remedy, "exchange the names");
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.warnings[0].code, "TRI-CAUSE");
  EXPECT_EQ(result.warnings[0].text, "likeliest cause: with cameras a and b exchanged 88 % fit");
  EXPECT_EQ(result.warnings[0].hint, "exchange the names");
  const auto& causes = result.metrics["causes"];
  ASSERT_EQ(causes.size(), 3u) << "as given first";
  EXPECT_EQ(causes[0]["carried"], 0.01);
  EXPECT_EQ(causes[1]["cause"], "exchanged");
  EXPECT_EQ(causes[1]["clear"], true);
  EXPECT_EQ(causes[2]["residual_px"], 24);
}

TEST(LikelyCause, WithoutAClearCauseItSaysWhatEachWouldLeave) {
  CommandResult result, nothing;
  triangulate::CauseReport report = Report();
  report.as_given.num_detections = 100;
  EXPECT_EQ(Said(CauseOfLoss(report, "TRI-CAUSE", "look at it"), &result).remedy, "look at it");
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(
      result.warnings[0].text,
      "none of the likely causes explains it: of the detections in a sample 1 % fit together as given, 87.5 % with cameras a "
      "and b exchanged, 0 % with camera c mirrored");
  EXPECT_EQ(result.metrics["causes"].size(), 3u);
  EXPECT_EQ(Said(CauseOfLoss(triangulate::CauseReport(), "TRI-CAUSE", "look at it"), &nothing).remedy, "look at it");
  EXPECT_TRUE(nothing.warnings.empty());
  EXPECT_EQ(nothing.metrics["causes"].size(), 1u);
}

TEST(LikelyCause, OfOneCameraAmongGoodOnesItIsAnErrorUnlessTheCameraMoved) {
  triangulate::CauseReport report = Report();
  CommandResult unclear, rotated, moved;
  EXPECT_FALSE(Said(CauseInCamera(report, false), &unclear).clear);
  report.message = "with cameras a and b exchanged 88 % fit";
  EXPECT_TRUE(Said(CauseInCamera(report, false), &rotated).clear);
  EXPECT_EQ(rotated.exit, kExitQualityGate);
  ASSERT_EQ(rotated.errors.size(), 1u);
  EXPECT_EQ(rotated.errors[0].hint, "exchange the names");
  report.trials[0].cause = Cause::kMoved;
  EXPECT_FALSE(Said(CauseInCamera(report, false), &moved).clear);
  EXPECT_EQ(moved.exit, kExitOk);
}

/// All images mirrored, people in their middle: points are found, and scatter.
TEST(LikelyCause, OfScatterItIsAnErrorWhereItHalvesIt) {
  triangulate::CauseReport report = Report();
  report.trials[0].cause = Cause::kMirrored, report.message = "with the images of all cameras mirrored 100 % fit";
  CommandResult mirrored, moved, little, timing;
  EXPECT_TRUE(Said(CauseInScatter(report, false), &mirrored).clear);
  EXPECT_EQ(mirrored.exit, kExitQualityGate);
  EXPECT_EQ(mirrored.errors.at(0).code, "TRI-CAUSE");
  report.trials[0].cause = Cause::kMoved;
  EXPECT_TRUE(Said(CauseInScatter(report, false), &moved).clear) << "a camera that draws the others along";
  EXPECT_EQ(moved.exit, kExitQualityGate);
  report.trials[0].cause = Cause::kMirrored, report.trials[0].residual_px = 15;
  EXPECT_FALSE(Said(CauseInScatter(report, false), &little).clear) << "a rig that fits a little better by chance";
  EXPECT_EQ(little.exit, kExitOk);
  report.trials[1].cause = Cause::kTimeOffset, report.trials[1].residual_px = 20, report.trials[1].offset_frames = 3;
  EXPECT_FALSE(Said(CauseInScatter(report, false), &timing).clear);
  ASSERT_EQ(timing.warnings.size(), 1u);
  EXPECT_EQ(timing.warnings[0].code, "TRI-TIMING") << "what the motion says of the clocks is kept";
}

/// Another cause fits a little better, and by itself says nothing: the clocks' own is told.
TEST(LikelyCause, OfScatterAClearOffsetIsAnErrorThoughAnotherCauseComesFirst) {
  triangulate::CauseReport report = Report();
  report.message = "with cameras a and b exchanged 88 % fit";
  report.trials[0].residual_px = 15;
  triangulate::CauseTrial& offset = report.trials[1];
  offset.cause = Cause::kTimeOffset, offset.assumption = "with a 3.0 frames later", offset.carried = 0.75;
  offset.residual_px = 16, offset.offset_frames = 3, offset.clear = true;
  CommandResult timing, unclear;
  EXPECT_TRUE(Said(CauseInScatter(report, false), &timing).clear);
  EXPECT_EQ(timing.exit, kExitQualityGate);
  ASSERT_EQ(timing.errors.size(), 1u);
  EXPECT_EQ(timing.errors[0].code, "TRI-TIMING");
  EXPECT_EQ(
      timing.errors[0].text,
      "the cameras are not synchronous: with a 3.0 frames later, 75 % of the detections in a sample fit together, as given "
      "1 %; mean residual 16.00 px instead of 25.00 px");
  offset.clear = false;
  EXPECT_FALSE(Said(CauseInScatter(report, false), &unclear).clear);
  EXPECT_EQ(unclear.exit, kExitOk);
}

TEST(Timing, AGainThatDoesNotMatterIsNotSaidNorAdviceThatWasFollowed) {
  triangulate::CauseReport report = Report();
  report.as_given.residual_px = 7.454, report.trials[0].residual_px = 7.449, report.trials[0].offset_frames = 0.6;
  CommandResult none, again;
  EXPECT_FALSE(Said(CauseInTiming(report, true), &none).clear);
  EXPECT_TRUE(none.warnings.empty());
  report.trials[0].residual_px = 5, report.trials[0].remedy = "run sync";
  EXPECT_FALSE(Said(CauseInTiming(report, true), &again).clear);
  ASSERT_EQ(again.warnings.size(), 1u);
  EXPECT_NE(again.warnings[0].hint, "run sync");
}

TEST(Timing, HalfAFrameIsAnErrorLessAWarningAndNothingNothing) {
  triangulate::CauseReport report = Report();
  CommandResult nothing, whole, part;
  EXPECT_FALSE(Said(CauseInTiming(report, false), &nothing).clear);
  EXPECT_FALSE(nothing.metrics.contains("causes"));
  report.trials[0].offset_frames = 4;  // sure, but the residuals hardly tell
  CommandResult slow;
  EXPECT_FALSE(Said(CauseInTiming(report, false), &slow).clear);
  ASSERT_EQ(slow.warnings.size(), 1u);
  EXPECT_EQ(slow.warnings[0].code, "TRI-TIMING");
  EXPECT_EQ(slow.exit, kExitOk);
  report.message = "with a 1.0 frames later 99 % fit", report.trials[0].offset_frames = 1;
  EXPECT_TRUE(Said(CauseInTiming(report, false), &whole).clear);
  EXPECT_EQ(whole.exit, kExitQualityGate);
  ASSERT_EQ(whole.errors.size(), 1u);
  EXPECT_EQ(whole.errors[0].code, "TRI-TIMING");
  report.trials[0].offset_frames = 0.4;
  EXPECT_TRUE(Said(CauseInTiming(report, false), &part).clear);
  EXPECT_EQ(part.exit, kExitOk);
  EXPECT_EQ(part.warnings.size(), 1u);
}

}  // namespace
}  // namespace mvstudio::stages
