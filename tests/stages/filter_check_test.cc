#include "stages/triangulate/filter_check.h"

#include <limits>

#include "tests/support/test.h"

namespace mvstudio::stages {
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

  FilterCheck fast;  // the median stays, the quantile of fast joints does not
  fast.before.median_px = 1.44, fast.before.p90_px = 2.65;
  fast.difference.num_samples = 1000, fast.difference.p90_px = 0.41, fast.difference.p90_error_px = 0.1;
  EXPECT_TRUE(fast.Hurts());
  fast.difference.p90_error_px = 0.21;
  EXPECT_FALSE(fast.Hurts()) << "within two standard errors";
  fast.difference.p90_px = 0.05, fast.difference.p90_error_px = 0.001;
  EXPECT_FALSE(fast.Hurts()) << "less than 2 %";
  fast.difference.p90_px = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(fast.Hurts()) << "a tenth is no longer predicted";
}

}  // namespace
}  // namespace mvstudio::stages
