#include "core/text/row_times.h"

#include <cmath>

#include "tests/support/test.h"

namespace mvstudio {
namespace {

TEST(RowTimes, GapsStayGapsAndRoundingDoesNotAddUp) {
  std::string why;
  EXPECT_THAT(FramesOfTimes({0.2, 0.3, 0.4, 0.8, 0.8}, &why)->frames, ElementsAre(2, 3, 4, 8, 8));
  std::vector<double> stamps;  // 30 Hz in whole milliseconds
  for (int frame = 0; frame < 9000; ++frame) stamps.push_back(std::round(frame * 1000 / 30.0));
  const auto found = FramesOfTimes(stamps, &why);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->frames.back(), 8999);
  EXPECT_NEAR(found->step, 1000 / 30.0, 1e-3);
}

TEST(RowTimes, AKnownStepCounts) {
  std::string why;
  EXPECT_THAT(FramesOfTimes({0, 2, 4}, &why, 1)->frames, ElementsAre(0, 2, 4));
  EXPECT_THAT(FramesOfTimes({3}, &why, 1)->frames, ElementsAre(3));
  EXPECT_FALSE(FramesOfTimes({0, 1.5, 3}, &why, 1));
}

TEST(RowTimes, WhatTellsNothingIsSaid) {
  const auto why = [](const std::vector<double>& times) {
    std::string text;
    EXPECT_FALSE(FramesOfTimes(times, &text));
    return text;
  };
  EXPECT_THAT(why({0, 1}), HasSubstr("fewer than three"));
  EXPECT_THAT(why({0, 1, 0.5}), HasSubstr("comes after"));
  EXPECT_THAT(why({0, 1, 2, 3.5}), HasSubstr("no multiple"));
  EXPECT_THAT(why({0, 1, std::nan(""), 3}), HasSubstr("a row has none"));
  EXPECT_THAT(why({1.7e9, 1.7e9 + 0.1, 1.7e9 + 0.2}), HasSubstr("recording's start"));
}

TEST(RowTimes, Names) {
  for (const char* name : {"time", "Time (s)", "time_ms", "timestamp", "t", "Timestamp [us]", "seconds"})
    EXPECT_TRUE(IsTimeColumn(name)) << name;
  for (const char* name : {"frame", "time_x", "wrist_x", "type", ""}) EXPECT_FALSE(IsTimeColumn(name)) << name;
}

}  // namespace
}  // namespace mvstudio
