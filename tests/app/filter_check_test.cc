#include "app/people/filter_check.h"

#include <gtest/gtest.h>

namespace mvstudio::app {
namespace {

bool Hurts(double before_px, double difference_px, double error_px, int num_samples = 1000) {
  FilterCheck check;
  check.before.median_px = before_px, check.after.median_px = before_px + difference_px;
  check.difference.num_samples = num_samples;
  check.difference.median_px = difference_px, check.difference.median_error_px = error_px;
  return check.Hurts();
}

/// Rounding of a take in which nobody moves is no harm, however sure it is.
TEST(FilterCheck, HarmIsBeyondDoubtAndLargeEnoughToMatter) {
  EXPECT_FALSE(Hurts(5.063, 3.9e-13, 0));
  EXPECT_FALSE(Hurts(1.437, 0.0091, 0.0001)) << "0.6 % of the median";
  EXPECT_FALSE(Hurts(1.437, 0.0788, 0.0495)) << "within two standard errors";
  EXPECT_TRUE(Hurts(1.437, 0.1043, 0.0384));
  EXPECT_TRUE(Hurts(1.437, 3.13, 0.63));
  EXPECT_FALSE(Hurts(1.635, -0.3, 0.02)) << "better";
  EXPECT_FALSE(Hurts(1, 1, 0.1, 0)) << "nobody was left out";
}

}  // namespace
}  // namespace mvstudio::app
