#include "calib/rig/frame_rate.h"

#include <cmath>

#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// The board in camera a at a time in its frames, carried about.
geometry::Rigid3 CarriedAt(double t) {
  geometry::Rigid3 pose;
  pose.rotation = geometry::RotationExp({0.4 * std::sin(0.11 * t), 0.3 * std::sin(0.07 * t + 1), 0.2 * std::sin(0.05 * t)});
  pose.translation = Eigen::Vector3d(0.4 * std::sin(0.13 * t), 0.3 * std::sin(0.09 * t + 2), 1.5 + 0.3 * std::sin(0.08 * t));
  return pose;
}

/// b's frame f at a's time ratio * f + offset, for both cameras' frames up to 120.
std::optional<FrameRate> Found(double ratio, double offset) {
  geometry::Rigid3 b_from_a;
  b_from_a.rotation = geometry::RotationExp({0, 0.5, 0.1});
  b_from_a.translation = Eigen::Vector3d(-0.6, 0.1, 0.2);
  BoardPoses a, b;
  for (int f = 0; f < 120; ++f) {
    a[{f, 0}] = CarriedAt(f);
    b[{f, 0}] = b_from_a * CarriedAt(ratio * f + offset);
  }
  return FindFrameRate(a, b);
}

TEST(FrameRate, RatiosAreFoundWithTheirOffset) {
  const auto half = Found(2, 3);
  ASSERT_TRUE(half.has_value());
  EXPECT_EQ(half->numerator, 2 * half->denominator);
  EXPECT_EQ(half->offset, 3);
  const auto twice = Found(0.5, 0.5);
  ASSERT_TRUE(twice.has_value());
  EXPECT_EQ(twice->denominator, 2 * twice->numerator);
  EXPECT_EQ(twice->At(7), 4);
  EXPECT_EQ(ToString({{}, *twice}, {"left", "right"}),
            "2 frames of right last as long as 1 of the others (its frame f is their frame (f +1) / 2)");
  const auto film = Found(6.0 / 5, 0);
  ASSERT_TRUE(film.has_value());
  EXPECT_EQ(5 * film->numerator, 6 * film->denominator);
}

TEST(FrameRate, EqualRatesAreNone) {
  EXPECT_FALSE(Found(1, 0).has_value());
  EXPECT_FALSE(Found(1, 17).has_value());
}

/// Frames that belong together in no way agree by chance where few of them meet: a board that rests at the ends of a recording.
TEST(FrameRate, RestsAtTheEndsAreNoRate) {
  BoardPoses a, b;
  for (int f = 0; f < 70; ++f) {
    const bool rests_in_a = f >= 52, rests_in_b = f < 18;
    a[{f, 0}] = rests_in_a ? CarriedAt(3) : CarriedAt(f);
    b[{f, 0}] = rests_in_b ? CarriedAt(4) : CarriedAt(500 + 7.3 * f);
  }
  EXPECT_FALSE(FindFrameRate(a, b).has_value());
}

TEST(FrameRate, MapsFramesThere) {
  const FrameRate rate{3, 2, 4};
  EXPECT_EQ(rate.At(6), 11);
  EXPECT_FALSE(rate.At(5).has_value());
  EXPECT_EQ(rate.Inverse().At(11), 6);
  std::vector<Detection> detections(4);
  for (int f = 0; f < 4; ++f) detections[static_cast<size_t>(f)].frame_idx = f;
  ApplyFrameRates({{1, 2, 1}}, &detections);
  ASSERT_EQ(detections.size(), 2u);
  EXPECT_EQ(detections[0].frame_idx, 1);
  EXPECT_EQ(detections[1].frame_idx, 2);
}

}  // namespace
}  // namespace mvstudio::calib
