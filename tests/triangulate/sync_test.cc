#include "triangulate/sync/sync.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "triangulate/sync/joint_tracks.h"

/// The parts of the synchronisation; sync_motion_integration_test.cc has the whole.
namespace mvstudio::triangulate {
namespace {

TEST(SampleTrack, ExactForQuadratics) {
  internal::JointTrack track;
  const auto at = [](double t) { return Eigen::Vector2d(3 + 2 * t - 0.1 * t * t, 100 - t); };
  for (int f = 5; f < 30; ++f) {
    if (f != 12 && f != 13) track.emplace_back(f, at(f));
  }
  for (const double t : {5.0, 6.3, 12.4, 20.0, 29.0}) {
    const auto sample = internal::SampleTrack(track, t);
    ASSERT_TRUE(sample) << t;
    EXPECT_LT((sample->px - at(t)).norm(), 1e-9);
    EXPECT_LT((sample->px_per_frame - Eigen::Vector2d(2 - 0.2 * t, -1)).norm(), 1e-9);
  }
  EXPECT_FALSE(internal::SampleTrack(track, 4.9));
  EXPECT_FALSE(internal::SampleTrack(track, 29.1));
}

std::vector<DetectedFrame> OneCamera(const std::function<Eigen::Vector2d(double)>& at, const std::vector<int>& numbers) {
  std::vector<DetectedFrame> frames;
  for (const int f : numbers) frames.push_back({f, {{{{at(f), 0.8}, {at(f + 7), f == 4 ? 0.0 : 0.5}}}}});
  return frames;
}

TEST(ApplyOffsets, WholeOffsetsRenumber) {
  const auto frames = OneCamera([](double t) { return Eigen::Vector2d(t, 2 * t); }, {10, 11, 13});
  const auto shifted = ApplyOffsets(frames, {10});
  ASSERT_EQ(shifted.size(), 3u);
  EXPECT_EQ(shifted[0].frame, 0);
  EXPECT_EQ(shifted[2].frame, 3);
  EXPECT_EQ(shifted[2].people[0][0][0].px, frames[2].people[0][0][0].px);
}

TEST(ApplyOffsets, FractionsFollowCubics) {
  const auto at = [](double t) { return Eigen::Vector2d(1 + t * t - 0.1 * t * t * t, 5 * t); };
  const auto shifted = ApplyOffsets(OneCamera(at, {0, 1, 2, 3, 4, 5, 8, 9}), {0.25});
  // Frame 5.25 falls into the gap.
  std::vector<int> numbers;
  for (const DetectedFrame& frame : shifted) numbers.push_back(frame.frame);
  EXPECT_EQ(numbers, (std::vector<int>{0, 1, 2, 3, 4, 8}));
  EXPECT_LT((shifted[2].people[0][0][0].px - at(2.25)).norm(), 1e-12);
  EXPECT_LT((shifted[0].people[0][0][0].px - (0.75 * at(0) + 0.25 * at(1))).norm(), 1e-12);
  EXPECT_EQ(shifted[2].people[0][0][0].score, 0.8);
  EXPECT_EQ(shifted[3].people[0][0][1].score, 0);  // missing in frame 4
}

/// Measured offsets of cameras that started together scatter about 0: no frame at an end is lost for that.
TEST(ApplyClocks, EndsAreExtendedByALine) {
  const auto at = [](double t) { return Eigen::Vector2d(1 + 2 * t, 5 * t); };
  const std::vector<int> all = {0, 1, 2, 3, 4, 5, 8, 9};
  const auto numbers = [&](double offset, double beyond) {
    std::vector<int> list;
    for (const DetectedFrame& frame : ApplyClocks(OneCamera(at, all), {{offset, 1}}, beyond)) {
      list.push_back(frame.frame);
      EXPECT_LT((frame.people[0][0][0].px - at(frame.frame + offset)).norm(), 1e-12) << frame.frame;
    }
    return list;
  };
  EXPECT_EQ(numbers(-0.02, 0.05), all);
  EXPECT_EQ(numbers(0.02, 0.05), all);
  EXPECT_EQ(numbers(-0.02, 0), (std::vector<int>{1, 2, 3, 4, 5, 9}));
  EXPECT_EQ(numbers(0.02, 0), (std::vector<int>{0, 1, 2, 3, 4, 8}));
  EXPECT_EQ(numbers(-0.06, 0.05), (std::vector<int>{1, 2, 3, 4, 5, 9}));
  const auto alone = ApplyClocks(OneCamera(at, {4}), {{-0.02, 1}}, 0.05);
  EXPECT_TRUE(alone.empty()) << "one frame has no line";
}

TEST(ApplyOffsets, NaNLeavesTheCameraOut) {
  auto frames = OneCamera([](double t) { return Eigen::Vector2d(t, t); }, {0, 1});
  for (DetectedFrame& frame : frames) frame.people.push_back(frame.people[0]);
  const auto shifted = ApplyOffsets(frames, {0, std::nan("")});
  ASSERT_EQ(shifted.size(), 2u);
  EXPECT_TRUE(shifted[0].people[1].empty());
}

}  // namespace
}  // namespace mvstudio::triangulate
