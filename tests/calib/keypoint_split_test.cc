#include <algorithm>

#include "calib/keypoints/split.h"
#include "core/error.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

std::vector<int> Frames(int count, int step) {
  std::vector<int> frames(static_cast<size_t>(count));
  std::generate(frames.begin(), frames.end(), [n = 0, step]() mutable { return step * n++; });
  return frames;
}

std::vector<KeypointJoint> Joints(const std::vector<int>& frames, int points_per_frame) {
  std::vector<KeypointJoint> joints;
  for (const int frame : frames)
    for (int j = 0; j < points_per_frame; ++j) joints.push_back({frame, 0, j, std::vector<triangulate::Observation>(2)});
  return joints;
}

TEST(KeypointSplit, HalvesAreContiguousWithAGap) {
  for (const auto& [count, step, gap_frames, left_out] : {std::tuple(1000, 1, 30, 30),
                                                          {1000, 10, 30, 3},
                                                          {1000, 1000, 30, 2},
                                                          {100, 1, 30, 5},
                                                          {12, 1, 30, 0},
                                                          {1000, 1, 0, 2}}) {
    const std::vector<int> frames = Frames(count, step), part = CutWithGaps(frames, 2, gap_frames);
    EXPECT_EQ(std::count(part.begin(), part.end(), -1), left_out) << count << " " << step;
    const auto first_gap = std::find(part.begin(), part.end(), -1), second = std::find(part.begin(), part.end(), 1);
    EXPECT_TRUE(std::all_of(part.begin(), left_out > 0 ? first_gap : second, [](int p) { return p == 0; }));
    EXPECT_TRUE(std::all_of(second, part.end(), [](int p) { return p == 1; }));
    EXPECT_NEAR(static_cast<double>(std::count(part.begin(), part.end(), 0)), count / 2 - left_out / 2, 1);
  }
}

TEST(KeypointSplit, PartsHaveGapsBetweenThem) {
  const std::vector<int> part = CutWithGaps(Frames(200, 1), 5, 3);
  EXPECT_EQ(std::count(part.begin(), part.end(), -1), 4 * 3);
  for (int p = 0; p < 5; ++p) EXPECT_GE(std::count(part.begin(), part.end(), p), 36) << p;
  EXPECT_TRUE(CutWithGaps({}, 2, 30).empty());
  EXPECT_EQ(CutWithGaps({7}, 2, 30), std::vector<int>{0});
  EXPECT_EQ(CutWithGaps({7, 9}, 5, 30).size(), 2u);  // fewer frames than parts
}

TEST(KeypointSplit, EachHalfMeasuresTheOther) {
  const auto joints = Joints(Frames(100, 1), 3);
  const KeypointSplit first = HalveKeypoints(joints, 0, 30), second = HalveKeypoints(joints, 1, 30);
  EXPECT_EQ(FramesOf(first.train), FramesOf(second.test));
  EXPECT_EQ(FramesOf(first.test), FramesOf(second.train));
  EXPECT_LT(FramesOf(first.train).back() + 5, FramesOf(first.test).front());
}

TEST(KeypointSplit, FlagsDecideWhereTheyAreGiven) {
  const auto joints = Joints(Frames(20, 1), 1);
  const KeypointSplit by_test = SplitKeypoints(joints, {}, FrameChoice{12, 1});
  EXPECT_EQ(FramesOf(by_test.train).back(), 11);
  EXPECT_EQ(FramesOf(by_test.test).front(), 12);
  EXPECT_THROW(SplitKeypoints(joints, FrameChoice{0, 2}, FrameChoice{0, 4}), UsageError);
}

/// 300 frames of a person; of a wand with two points as many as hold the same number of points.
TEST(KeypointSplit, FramesOfFewPointsAreNotThinnedSoFar) {
  EXPECT_EQ(FramesOf(Limited(Joints(Frames(1000, 1), 100), 300)).size(), 300u);
  EXPECT_EQ(FramesOf(Limited(Joints(Frames(1000, 1), 2), 300)).size(), 1000u);
  EXPECT_EQ(FramesOf(Limited(Joints(Frames(10000, 1), 2), 300)).size(), 4500u);
}

}  // namespace
}  // namespace mvstudio::calib
