#include "dataset/pose/score_scale.h"

#include <vector>

#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

Pose2dTrack TrackOf(const std::vector<double>& scores) {
  Pose2dTrack track{"a", {}};
  Person2d person;
  for (const double score : scores) person.keypoints.push_back({10, 20, score});
  track.frames[0] = {person};
  return track;
}

ScoreScale ScaleOf(const std::vector<double>& scores) {
  ScoreCounts counts;
  counts.Add(TrackOf(scores));
  return counts.Scale();
}

TEST(ScoreScale, OfTheWholeSource) {
  EXPECT_EQ(ScaleOf({}), ScoreScale::kOne);
  EXPECT_EQ(ScaleOf({0, 0.5, 1, 1.03, 0.9, 1.2}), ScoreScale::kOne) << "peaks a little above 1";
  EXPECT_EQ(ScaleOf({0, 1, 2, 2, 2, 2, 2}), ScoreScale::kFlags) << "COCO's visibility";
  EXPECT_EQ(ScaleOf({0, 0.5, 12, 99.2, 88, 75, 42}), ScoreScale::kPercent);
  EXPECT_EQ(ScaleOf({0, 1, 12, 255, 180, 75, 42}), ScoreScale::kBytes);
  EXPECT_EQ(ScaleOf({0.2, 3.5, 7.1, 6.5, 2.2, 4.5}), ScoreScale::kPeaks);
  EXPECT_EQ(ScaleOf({-3, -2.5, -1.5, 4, 5, -0.7, -4}), ScoreScale::kLogits);
  EXPECT_EQ(ScaleOf({-1, -1, -1, -1, -1, -1, 0.5, 0.9}), ScoreScale::kOne) << "-1: not seen";
  EXPECT_EQ(ScaleOf({300, 900, 512, 777, 850, 12}), ScoreScale::kUnknown);
  EXPECT_EQ(ScaleOf({120.5, 200.25, 130, 180, 140, 12}), ScoreScale::kUnknown) << "bytes are whole";
}

TEST(ScoreScale, OneOddNumberDecidesNothing) {
  std::vector<double> scores(200, 0.8);
  scores[17] = 87;
  EXPECT_EQ(ScaleOf(scores), ScoreScale::kOne);
}

TEST(ScoreScale, PointsWithoutScoresAtTheCornerAreNotSeen) {
  EXPECT_EQ(ScoreOfUnscored(0, 0), 0);
  EXPECT_EQ(ScoreOfUnscored(-1, -1), 0);
  EXPECT_EQ(ScoreOfUnscored(0, 12), 1);
  EXPECT_EQ(ScoreOfUnscored(30, 30), 1);
}

TEST(ScoreScale, BecomeSharesOfOne) {
  Pose2dTrack percent = TrackOf({0, 50, 100.2, -1}), bytes = TrackOf({255, 51}), flags = TrackOf({1, 2, 0});
  ScoresToShares(ScoreScale::kPercent, &percent);
  ScoresToShares(ScoreScale::kBytes, &bytes);
  ScoresToShares(ScoreScale::kFlags, &flags);
  const auto score = [](const Pose2dTrack& track, size_t k) { return track.frames.at(0)[0].keypoints[k].score; };
  EXPECT_EQ(score(percent, 0), 0);
  EXPECT_EQ(score(percent, 1), 0.5);
  EXPECT_EQ(score(percent, 2), 1);
  EXPECT_LT(score(percent, 3), 0);
  EXPECT_EQ(score(bytes, 0), 1);
  EXPECT_EQ(score(bytes, 1), 0.2);
  EXPECT_EQ(score(flags, 0), 1);
  EXPECT_EQ(score(flags, 1), 1);
  EXPECT_EQ(score(flags, 2), 0);
}

}  // namespace
}  // namespace mvstudio::dataset
