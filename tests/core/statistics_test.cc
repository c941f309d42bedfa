#include "core/statistics.h"

#include <cmath>
#include <vector>

#include "tests/support/test.h"

namespace mvstudio {
namespace {

using Values = std::vector<double>;

const Values kFour = {4, 1, 3, 2};

TEST(UpperMedian, IsTheLargerOfTwoMiddleValues) {
  EXPECT_EQ(UpperMedian(Values{3, 1, 2}), 2);
  EXPECT_EQ(UpperMedian(kFour), 3);
  EXPECT_EQ(UpperMedian(Values{7}), 7);
  EXPECT_EQ(UpperMedian(Values{1, INFINITY, 2}), 2);
}

TEST(UpperMedian, OfNothingIsWhatTheCallerSays) {
  EXPECT_TRUE(std::isnan(UpperMedian(Values{})));
  EXPECT_EQ(UpperMedian(Values{}, -1), -1);
  EXPECT_EQ(UpperMedian(std::vector<int>{}, 5), 5);
}

TEST(UpperMedian, OfARangeLooksAtNothingBeyondIt) {
  std::vector<unsigned char> values = {9, 200, 7, 0, 0, 0};
  EXPECT_EQ(UpperMedian(values.begin(), values.begin() + 3), 9);
}

TEST(ValueOfRank, CountsFromTheLeast) {
  for (int rank = 0; rank < 4; ++rank) {
    Values values = kFour;
    EXPECT_EQ(ValueOfRank(values.begin(), values.end(), rank), rank + 1);
  }
}

TEST(Quantile, BetweenTwoValuesTheDefinitionsDiffer) {
  EXPECT_EQ(LinearQuantile(kFour, 0.5), 2.5);
  EXPECT_EQ(LowerQuantile(kFour, 0.5), 2);
  EXPECT_EQ(NearestQuantile(kFour, 0.5), 3);  // halfway: the upper one
  EXPECT_EQ(ShareQuantile(kFour, 0.5), 2);
  EXPECT_EQ(UpperQuantile(kFour, 0.5), 3);
  EXPECT_DOUBLE_EQ(LinearQuantile(kFour, 0.9), 3.7);
  EXPECT_EQ(LowerQuantile(kFour, 0.9), 3);
  EXPECT_EQ(NearestQuantile(kFour, 0.9), 4);
  EXPECT_EQ(ShareQuantile(kFour, 0.9), 4);
  EXPECT_EQ(UpperQuantile(kFour, 0.9), 4);
  EXPECT_DOUBLE_EQ(LinearQuantile(kFour, 0.3), 1.9);
  EXPECT_EQ(LowerQuantile(kFour, 0.3), 1);
  EXPECT_EQ(NearestQuantile(kFour, 0.3), 2);
  EXPECT_EQ(ShareQuantile(kFour, 0.25), 1);
  EXPECT_EQ(UpperQuantile(kFour, 0.25), 2);
}

TEST(Quantile, TheEndsAreTheLeastAndTheLargest) {
  for (const double value :
       {LinearQuantile(kFour, 0), LowerQuantile(kFour, 0), NearestQuantile(kFour, 0), UpperQuantile(kFour, 0)})
    EXPECT_EQ(value, 1);
  for (const double value :
       {LinearQuantile(kFour, 1), LowerQuantile(kFour, 1), NearestQuantile(kFour, 1), ShareQuantile(kFour, 1)})
    EXPECT_EQ(value, 4);
}

TEST(Quantile, AtAValueAllAgree) {
  const Values eleven = {10, 0, 1, 9, 2, 8, 3, 7, 4, 6, 5};
  EXPECT_EQ(LinearQuantile(eleven, 0.5), 5);
  EXPECT_EQ(LowerQuantile(eleven, 0.5), 5);
  EXPECT_EQ(NearestQuantile(eleven, 0.5), 5);
  EXPECT_EQ(ShareQuantile(eleven, 0.5), 5);
  EXPECT_EQ(UpperQuantile(eleven, 0.5), 5);
}

TEST(Quantile, OfNothingIsNan) {
  EXPECT_TRUE(std::isnan(LinearQuantile(Values{}, 0.5)));
  EXPECT_TRUE(std::isnan(LowerQuantile(Values{}, 0.5)));
  EXPECT_TRUE(std::isnan(NearestQuantile(Values{}, 0.5)));
  EXPECT_TRUE(std::isnan(ShareQuantile(Values{}, 0.5)));
  EXPECT_TRUE(std::isnan(UpperQuantile(Values{}, 0.5)));
}

TEST(Quantile, InfinitiesCount) {
  const Values values = {1, INFINITY, 2, INFINITY, INFINITY};
  EXPECT_EQ(LinearQuantile(values, 0.25), 2);  // no 0 times infinity
  EXPECT_EQ(LinearQuantile(values, 0.3), INFINITY);
  EXPECT_EQ(LinearQuantile(values, 0.6), INFINITY);
  EXPECT_EQ(UpperQuantile(values, 0.9), INFINITY);
}

TEST(Quantile, OfSingleNumbersIsReckonedInDouble) {
  EXPECT_EQ(LinearQuantile(std::vector<float>{1, 1 + 0x1p-23f}, 0.5), 1 + 0x1p-24);
}

TEST(FiniteValues, KeepTheirOrder) {
  EXPECT_EQ(FiniteValues(Values{3, NAN, 1, -INFINITY, 2}), (Values{3, 1, 2}));
  EXPECT_TRUE(FiniteValues(Values{NAN}).empty());
  EXPECT_EQ(LinearQuantile(FiniteValues(Values{3, 1, NAN, 2}), 0.5), 2);
}

TEST(Spread, OfAFewValues) {
  const Values values = {1, 3, 5, 7};  // about 4: -3, -1, 1, 3
  EXPECT_EQ(Mean(values), 4);
  EXPECT_EQ(Mean(std::vector<float>{1, 2}), 1.5);
  EXPECT_DOUBLE_EQ(Rms(values), std::sqrt(21.0));
  EXPECT_EQ(SquaredDeviations(values), 20);
  EXPECT_DOUBLE_EQ(PopulationDeviation(values), std::sqrt(5.0));
  EXPECT_DOUBLE_EQ(SampleDeviation(values), std::sqrt(20.0 / 3));
}

TEST(Spread, OfTooFewValuesIsNan) {
  EXPECT_TRUE(std::isnan(Mean(Values{})));
  EXPECT_TRUE(std::isnan(Rms({})));
  EXPECT_TRUE(std::isnan(PopulationDeviation({})));
  EXPECT_TRUE(std::isnan(SampleDeviation({2})));
  EXPECT_EQ(PopulationDeviation({2}), 0);
}

TEST(Spread, RobustSigmaOfANormalDistribution) { EXPECT_NEAR(kSigmaPerMad * 0.6744898, 1, 1e-5); }  // R: qnorm(0.75)

}  // namespace
}  // namespace mvstudio
