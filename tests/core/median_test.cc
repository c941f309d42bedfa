#include "core/median.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace mvstudio {
namespace {

TEST(UpperMedian, IsTheLargerOfTwoMiddleValues) {
  EXPECT_EQ(UpperMedian(std::vector<double>{3, 1, 2}), 2);
  EXPECT_EQ(UpperMedian(std::vector<double>{4, 1, 3, 2}), 3);
  EXPECT_EQ(UpperMedian(std::vector<double>{7}), 7);
  EXPECT_EQ(UpperMedian(std::vector<double>{1, INFINITY, 2}), 2);
}

TEST(UpperMedian, OfNothingIsWhatTheCallerSays) {
  EXPECT_TRUE(std::isnan(UpperMedian(std::vector<double>{})));
  EXPECT_EQ(UpperMedian(std::vector<double>{}, -1), -1);
  EXPECT_EQ(UpperMedian(std::vector<int>{}, 5), 5);
}

TEST(UpperMedian, OfARangeLooksAtNothingBeyondIt) {
  std::vector<unsigned char> values = {9, 200, 7, 0, 0, 0};
  EXPECT_EQ(UpperMedian(values.begin(), values.begin() + 3), 9);
}

}  // namespace
}  // namespace mvstudio
