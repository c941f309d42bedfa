#include "app/people/likely_cause.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace mvstudio::app {
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

TEST(LikelyCause, AClearCauseIsToldAndItsRemedyReturned) {
  triangulate::CauseReport report = Report();
  report.message = "with cameras a and b exchanged 88 % fit";
  CommandResult result;
  EXPECT_EQ(AddLikelyCause(report, "TRI-CAUSE", "look at it", &result), "exchange the names");
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

TEST(LikelyCause, WithoutAClearCauseNothingIsSaid) {
  CommandResult result, nothing;
  EXPECT_EQ(AddLikelyCause(Report(), "TRI-CAUSE", "look at it", &result), "look at it");
  EXPECT_TRUE(result.warnings.empty());
  EXPECT_EQ(result.metrics["causes"].size(), 3u);
  EXPECT_EQ(AddLikelyCause({}, "TRI-CAUSE", "look at it", &nothing), "look at it");
  EXPECT_EQ(nothing.metrics["causes"].size(), 1u);
}

TEST(Timing, HalfAFrameIsAnErrorLessAWarningAndNothingNothing) {
  triangulate::CauseReport report = Report();
  CommandResult nothing, whole, part;
  EXPECT_FALSE(AddTiming(report, &nothing));
  EXPECT_FALSE(nothing.metrics.contains("causes"));
  report.trials[0].offset_frames = 4;  // sure, but the residuals hardly tell
  CommandResult slow;
  EXPECT_FALSE(AddTiming(report, &slow));
  ASSERT_EQ(slow.warnings.size(), 1u);
  EXPECT_EQ(slow.warnings[0].code, "TRI-TIMING");
  EXPECT_EQ(slow.exit, kExitOk);
  report.message = "with a 1.0 frames later 99 % fit", report.trials[0].offset_frames = 1;
  EXPECT_TRUE(AddTiming(report, &whole));
  EXPECT_EQ(whole.exit, kExitQualityGate);
  ASSERT_EQ(whole.errors.size(), 1u);
  EXPECT_EQ(whole.errors[0].code, "TRI-TIMING");
  report.trials[0].offset_frames = 0.4;
  EXPECT_TRUE(AddTiming(report, &part));
  EXPECT_EQ(part.exit, kExitOk);
  EXPECT_EQ(part.warnings.size(), 1u);
}

}  // namespace
}  // namespace mvstudio::app
