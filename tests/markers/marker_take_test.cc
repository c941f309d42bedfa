#include "dataset/markers/marker_take.h"

#include <cmath>

#include "core/error.h"
#include "dataset/markers/fill.h"
#include "dataset/markers/filter.h"
#include "dataset/markers/marker_files.h"
#include "tests/support/test.h"

namespace mvstudio::markers {
namespace {

dataset::JointRow Row(int frame, int person, const std::string& joint, const Eigen::Vector3d& x, int views = 3) {
  dataset::JointRow row;
  row.frame = frame, row.person = person, row.joint = joint;
  row.status = Status::kOk, row.x_in_world = x, row.num_views = views, row.sigma_m = 0.004;
  return row;
}

Eigen::Vector3d Parabola(int f) { return {0.1 * f, 2 - 0.03 * f + 0.002 * f * f, 0.001 * f * f}; }

/// One joint over 40 frames on a parabola, without the frames of `missing`.
MarkerTake OneJoint(const std::vector<int>& missing) {
  dataset::Pose3d pose;
  for (int f = 0; f < 40; ++f) {
    if (std::find(missing.begin(), missing.end(), f) == missing.end()) pose.rows.push_back(Row(100 + f, 0, "Paw", Parabola(f)));
  }
  return MarkersOf(pose, 50).at(0);
}

TEST(MarkersOf, KeepsEveryJointPersonAndFrame) {
  dataset::Pose3d pose;
  pose.rows = {Row(3, 0, "Nose", {1, 2, 3}), Row(3, 1, "Tail", {4, 5, 6}), Row(5, 0, "Tail", {7, 8, 9}, 0)};
  dataset::JointRow lost = Row(3, 0, "Tail", {0, 0, 0});
  lost.status = Status::kTooFewViews;
  pose.rows.insert(pose.rows.begin() + 1, lost);
  const auto takes = MarkersOf(pose, 30);
  ASSERT_EQ(takes.size(), 2u);
  EXPECT_THAT(takes[0].names, ElementsAre("Nose", "Tail"));
  EXPECT_EQ(takes[0].num_frames(), 3);
  EXPECT_EQ(takes[0].first_frame, 3);
  EXPECT_EQ(takes[0].source[takes[0].Index(0, 1)], Source::kMissing);
  EXPECT_EQ(takes[0].source[takes[0].Index(2, 1)], Source::kFilled);
  EXPECT_EQ(takes[0].x_in_world[takes[0].Index(2, 1)], Eigen::Vector3d(7, 8, 9));
  EXPECT_THAT(takes[1].names, ElementsAre("Tail"));
}

TEST(MarkersOf, RefusesWhatIsNoTake) {
  dataset::Pose3d pose;
  pose.rows = {Row(0, 0, "Nose", {1, 2, 3}), Row(2000000000, 0, "Nose", {1, 2, 3})};
  EXPECT_THROW(MarkersOf(pose, 30), UsageError);
  EXPECT_THROW(MarkersOf({}, 0), UsageError);
  EXPECT_THROW(MarkersOf({}, std::nan("")), UsageError);
  EXPECT_TRUE(MarkersOf({}, 30).empty());
}

TEST(FillGaps, ParabolasExactlyAndOnlyShortGaps) {
  MarkerTake take = OneJoint({10, 11, 12, 20, 21, 22, 23, 24, 25});
  const FillReport report = FillGaps(3, &take);
  EXPECT_EQ(report.num_gaps, 1);
  EXPECT_EQ(report.num_positions, 3);
  EXPECT_EQ(report.num_left, 6);
  for (const int f : {10, 11, 12}) {
    EXPECT_LT((take.x_in_world[take.Index(f, 0)] - Parabola(f)).norm(), 1e-12);
    EXPECT_EQ(take.source[take.Index(f, 0)], Source::kFilled);
    EXPECT_EQ(take.sigma_m[take.Index(f, 0)], 0);
  }
  EXPECT_FALSE(take.x_in_world[take.Index(22, 0)].allFinite());
}

TEST(FillGaps, EndsAreNoGaps) {
  MarkerTake take = OneJoint({1, 2, 37, 38});  // single positions at both ends
  EXPECT_EQ(FillGaps(100, &take).num_gaps, 2);
  for (int f = 0; f < 40; ++f) EXPECT_TRUE(take.x_in_world[take.Index(f, 0)].allFinite()) << f;
}

TEST(Filter, RunsAreFilteredOnTheirOwnAndNothingAppears) {
  for (const char* text : {"butterworth:6Hz", "kalman", "gaussian:0.04s", "median:5"}) {
    MarkerTake take = OneJoint({15, 16, 17});
    Filter(ParseFilter(text), &take);
    for (int f = 0; f < 40; ++f) {
      const bool missing = f >= 15 && f <= 17;
      EXPECT_EQ(take.x_in_world[take.Index(f, 0)].allFinite(), !missing) << text << " " << f;
      if (!missing) {
        EXPECT_LT((take.x_in_world[take.Index(f, 0)] - Parabola(f)).norm(), 0.25) << text << " " << f;
      }
    }
  }
}

TEST(Motion, AccelerationOfAParabolaAndDisplacement) {
  const MarkerTake take = OneJoint({});
  const auto motion = MeasureMotion(take);
  ASSERT_EQ(motion.size(), 1u);
  EXPECT_NEAR(motion[0].acceleration_m_s2, 2500 * std::hypot(0.004, 0.002), 1e-9);
  MarkerTake moved = take;
  for (auto& x : moved.x_in_world) x.x() += 0.008;
  EXPECT_NEAR(MeasureDisplacement(take, moved).rms_m, 0.008, 1e-12);
  EXPECT_NEAR(MeasureDisplacement(take, moved).rms_sigmas, 2 / std::sqrt(3.0), 1e-9);
  EXPECT_TRUE(std::isnan(MeanAcceleration(MeasureMotion(MarkerTake{}))));
}

TEST(Files, TextsHoldWhatTheTakeHolds) {
  MarkerTake take = OneJoint({2});
  take.names = {"Paw, left"};
  FillGaps(1, &take);
  EXPECT_THAT(TrcText(take, "a.trc"), HasSubstr("\n103\t0.04\t" + std::string("1948")));  // y of frame 102, mm
  EXPECT_THAT(CsvText(take), HasSubstr("102,0.04,\"Paw, left\",0.2,"));
  EXPECT_THAT(CsvText(take), HasSubstr(",,filled\n103,0.06,"));
  MarkerTake crowd = take;
  crowd.names.assign(256, "x");
  EXPECT_THROW(C3dBytes(crowd), UsageError);
}

}  // namespace
}  // namespace mvstudio::markers
