#include "dataset/colour/colour_space.h"

#include <cmath>

#include "tests/support/test.h"

namespace mvstudio::dataset::internal {
namespace {

/// IEC 61966-2-1: both ends, the joint of the two pieces, and the grey that sRGB calls 128 (21.6 % of the light).
TEST(ColourSpace, TheCurveOfTheStandard) {
  EXPECT_EQ(LinearFromSrgb(0), 0);
  EXPECT_DOUBLE_EQ(LinearFromSrgb(1), 1);
  EXPECT_NEAR(LinearFromSrgb(128 / 255.0), 0.21586, 1e-5);
  EXPECT_NEAR(LinearFromSrgb(0.04045), 0.0031308, 1e-7);
  EXPECT_NEAR(LinearFromSrgb(std::nextafter(0.04045, 1)), LinearFromSrgb(0.04045), 1e-7) << "the pieces meet";
  EXPECT_NEAR(SrgbFromLinear(0.5), 0.735357, 1e-6);
}

TEST(ColourSpace, ThereAndBackAlsoBeyondWhiteAndBelowBlack) {
  for (double srgb = -0.5; srgb <= 1.5; srgb += 0.003) {
    EXPECT_NEAR(SrgbFromLinear(LinearFromSrgb(srgb)), srgb, 1e-6) << srgb;
    EXPECT_EQ(LinearFromSrgb(-srgb), -LinearFromSrgb(srgb)) << srgb;
    constexpr double kStep = 1e-6;
    const double slope = (LinearFromSrgb(srgb + kStep) - LinearFromSrgb(srgb - kStep)) / (2 * kStep);
    EXPECT_NEAR(LinearSlope(srgb), slope, 1e-5) << srgb;
  }
}

TEST(ColourSpace, GainAndOffsetActInTheirSpace) {
  ColourTransform t;
  t.gain = Eigen::Array3d(2, 1, 0.5), t.offset = Eigen::Array3d(0, 0.1, 0);
  EXPECT_DOUBLE_EQ(Corrected(0.3, t, 0, ColourSpace::kSrgb), 0.6);
  EXPECT_DOUBLE_EQ(Corrected(0.3, t, 1, ColourSpace::kSrgb), 0.4);
  const double light = Corrected(0.3, t, 2, ColourSpace::kLinear);
  EXPECT_NEAR(LinearFromSrgb(light), 0.5 * LinearFromSrgb(0.3), 1e-12) << "half of the light";
  EXPECT_GT(light, 0.15);
}

}  // namespace
}  // namespace mvstudio::dataset::internal
