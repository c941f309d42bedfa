#include "core/choice/heldout_choice.h"

#include <cmath>
#include <vector>

#include "core/error.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

using Units = std::vector<double>;

/// The simple candidate and the complex one.
HeldOutChoice Choose(const Units& simple, const Units& complex, const HeldOutRule& rule = {}) {
  return ChooseHeldOut({{"simple", simple}, {"complex", complex}}, rule);
}

TEST(MeanOverUnits, HasTheStandardErrorOfTheMean) {
  const UnitMean mean = MeanOverUnits({1, NAN, 3, 5, 7});
  EXPECT_EQ(mean.mean, 4);
  EXPECT_NEAR(mean.standard_error, std::sqrt(5.0 / 3), 1e-15);  // squared deviations 20, over 3, over 4
  EXPECT_EQ(mean.num_units, 4);
}

TEST(MeanOverUnits, OfFewerThanTwoHasNoError) {
  EXPECT_EQ(MeanOverUnits({3}).mean, 3);
  EXPECT_EQ(MeanOverUnits({3}).standard_error, 0);
  EXPECT_TRUE(std::isnan(MeanOverUnits({}).mean));
  EXPECT_EQ(MeanOverUnits({NAN}).num_units, 0);
}

TEST(DifferenceOverUnits, IsOfPairs) {
  const UnitMean difference = DifferenceOverUnits({102, 1, NAN, 5}, {100, 0, 7, NAN});  // 2 and 1
  EXPECT_EQ(difference.mean, 1.5);
  EXPECT_EQ(difference.standard_error, 0.5);
  EXPECT_EQ(difference.num_units, 2);
}

TEST(DifferenceOverUnits, InfiniteOnBothSidesIsNone) {
  const UnitMean same = DifferenceOverUnits({INFINITY, 1}, {INFINITY, 1});
  EXPECT_EQ(same.mean, 0);
  EXPECT_EQ(same.standard_error, 0);
  EXPECT_EQ(DifferenceOverUnits({INFINITY, 1}, {1, 1}).mean, INFINITY);
}

TEST(DifferenceOfMeans, AddsVariances) {
  const UnitMean difference = DifferenceOfMeans({7, 3, 10}, {2, 4, 8});
  EXPECT_EQ(difference.mean, 5);
  EXPECT_EQ(difference.standard_error, 5);
  EXPECT_EQ(difference.num_units, 8);
}

TEST(InStandardErrors, WithoutAnErrorCountsTheSignAlone) {
  EXPECT_EQ(InStandardErrors({6, 2, 9}), 3);
  EXPECT_EQ(InStandardErrors({6, 0, 9}), INFINITY);
  EXPECT_EQ(InStandardErrors({0, 0, 9}), 0);
  EXPECT_EQ(InStandardErrors({6, INFINITY, 9}), 0);
}

TEST(IsAsGood, AnInfiniteErrorShowsNothing) {
  HeldOutRule rule;
  EXPECT_FALSE(IsAsGood({1, INFINITY, 9}, rule));
  EXPECT_TRUE(IsAsGood({1, 1, 9}, rule));
  rule.absolute = 1;
  EXPECT_TRUE(IsAsGood({1, INFINITY, 9}, rule));
  EXPECT_FALSE(IsAsGood({NAN, 0, 9}, rule));
}

TEST(ChooseHeldOut, TiesGoToTheSimpleOne) {
  const HeldOutChoice choice = Choose({1, 2, 3}, {1, 2, 3});
  EXPECT_EQ(choice.status, Status::kOk);
  EXPECT_EQ(choice.index, 0);
  EXPECT_EQ(choice.best, 0);
  EXPECT_TRUE(choice.verdicts[1].as_good);
  EXPECT_EQ(choice.reason, "simple has the smallest held-out error of all tried");
}

TEST(ChooseHeldOut, WithinTheMarginTheSimpleOneWins) {
  const HeldOutChoice choice = Choose({3, 1}, {0, 2});  // 3 and -1: 1 +- 2
  EXPECT_EQ(choice.best, 1);
  EXPECT_EQ(choice.index, 0);
  EXPECT_EQ(choice.verdicts[0].worse_by.mean, 1);
  EXPECT_EQ(choice.verdicts[0].worse_by.standard_error, 2);
  EXPECT_EQ(choice.reason,
            "simple is the simplest as good as the best (complex): held-out error +100.0 %, difference 1 +- 2 over 2 units");
}

TEST(ChooseHeldOut, BeyondTheMarginTheComplexOneWins) {
  HeldOutRule rule;
  EXPECT_EQ(Choose({3, 1}, {1, 0}, rule).index, 1);  // 2 and 1: 1.5 +- 0.5
  rule.standard_errors = 3;
  EXPECT_EQ(Choose({3, 1}, {1, 0}, rule).index, 0);
}

TEST(ChooseHeldOut, OneUnitAloneDecidesNothing) {
  EXPECT_EQ(Choose({4, 1, 1, 1}, {0, 1, 1, 1}, {}).index, 0);  // its mean is its standard error: 1 +- 1
}

TEST(ChooseHeldOut, TheFirstThatIsAsGoodIsTaken) {
  const HeldOutChoice choice = ChooseHeldOut({{"a", {9, 9}}, {"b", {3, 1}}, {"c", {0, 2}}, {"d", {9, 8}}}, {});
  EXPECT_EQ(choice.best, 2);
  EXPECT_EQ(choice.index, 1);
  EXPECT_FALSE(choice.verdicts[0].as_good);
  EXPECT_FALSE(choice.verdicts[3].as_good);
}

TEST(ChooseHeldOut, ASmallDifferenceCountsBeyondDoubtAlone) {
  const Units simple = {102, 101}, complex = {100, 100};  // 2 and 1: 3 standard errors; 1.5 %
  HeldOutRule rule;
  rule.relative = 0.02;
  EXPECT_EQ(Choose(simple, complex, rule).index, 0);
  rule.beyond_doubt = 2;
  EXPECT_EQ(Choose(simple, complex, rule).index, 1);
  rule.beyond_doubt = 3;
  EXPECT_EQ(Choose(simple, complex, rule).index, 0);
  rule.relative = 0.01;
  EXPECT_EQ(Choose(simple, complex, rule).index, 1);
  rule.absolute = 1.5;
  EXPECT_EQ(Choose(simple, complex, rule).index, 0);
}

TEST(ChooseHeldOut, LossesOfTheirOwnFindTheBest) {
  HeldOutRule rule;
  rule.relative = 0.1;
  const HeldOutChoice choice = ChooseHeldOut({{"simple", {3, 1}, 1.1}, {"complex", {1, 0}, 1.0}}, rule);
  EXPECT_EQ(choice.best, 1);
  EXPECT_EQ(choice.index, 0);
  EXPECT_EQ(choice.verdicts[0].loss, 1.1);
}

TEST(ChooseHeldOut, UnitsWithoutAValueTakeNoPart) {
  const HeldOutChoice choice = Choose({NAN, 3, 1, 100}, {50, 1, 0, NAN}, {});  // means 34.7 and 17; in pairs 2 and 1
  EXPECT_EQ(choice.best, 1);
  EXPECT_EQ(choice.index, 1);
  EXPECT_EQ(choice.verdicts[0].worse_by.num_units, 2);
  EXPECT_EQ(choice.verdicts[0].worse_by.mean, 1.5);
}

TEST(ChooseHeldOut, TooFewUnitsShowNothing) {
  HeldOutRule rule;
  rule.min_units = 3;
  const HeldOutChoice choice = Choose({3, 1}, {1, 0}, rule);
  EXPECT_EQ(choice.status, Status::kTooFewViews);
  EXPECT_EQ(choice.index, 0);
  EXPECT_EQ(choice.reason, "simple: 2 units held out, too few to choose by");
  EXPECT_EQ(Choose({}, {}).index, 0);
  rule.min_units = 1;
  EXPECT_EQ(Choose({3}, {1}, rule).index, 1);
}

TEST(ChooseHeldOut, AllInfiniteIsATie) {
  const HeldOutChoice choice = Choose({INFINITY, INFINITY}, {INFINITY, INFINITY});
  EXPECT_EQ(choice.status, Status::kTooFewViews);
  EXPECT_EQ(choice.index, 0);
  EXPECT_TRUE(choice.verdicts[1].as_good);
}

TEST(ChooseHeldOut, WhatPredictsNothingIsNeverAsGood) {
  EXPECT_EQ(Choose({INFINITY, 1}, {5, 5}).index, 1);
  EXPECT_EQ(Choose({NAN, NAN}, {5, 5}).index, 1);
}

TEST(ChooseHeldOut, NoCandidateIsAMistake) { EXPECT_THROW(ChooseHeldOut({}, {}), ContractViolation); }

}  // namespace
}  // namespace mvstudio
