#include "calib/lens/evidence.h"

#include <cmath>
#include <limits>

#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

TEST(GainBeyondCost, WhatIsLeftAfterTheCost) {
  const auto gain = GainBeyondCost({10, 12, 9, 11}, 15, 1);
  ASSERT_TRUE(gain);
  EXPECT_DOUBLE_EQ(*gain, 27);
}

TEST(GainBeyondCost, NothingBelowTheCost) {
  EXPECT_FALSE(GainBeyondCost({1, 1, 1, 1}, 4, 0));
  EXPECT_FALSE(GainBeyondCost({-5, 1}, 0, 0));
  EXPECT_FALSE(GainBeyondCost({}, 0, 0));
}

/// n equal parts have a sum of n and a standard error of sqrt(n); one part alone has a sum of one standard error.
TEST(GainBeyondCost, NothingFromAFewPartsAlone) {
  EXPECT_FALSE(GainBeyondCost({1000, 0, 0, 0, 0, 0, 0, 0, 0, 0}, 5, 3));
  EXPECT_FALSE(GainBeyondCost(std::vector<double>(9, 100), 5, 3));
  EXPECT_TRUE(GainBeyondCost(std::vector<double>(10, 100), 5, 3));
}

TEST(GainBeyondCost, NothingFromWhatIsNoNumber) {
  EXPECT_FALSE(GainBeyondCost({std::nan(""), 100}, 1, 1));
  EXPECT_FALSE(GainBeyondCost({100, 100}, std::nan(""), 1));
  EXPECT_FALSE(GainBeyondCost({std::numeric_limits<double>::infinity(), 1}, 1, 3));
}

}  // namespace
}  // namespace mvstudio::calib
