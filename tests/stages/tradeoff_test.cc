#include "stages/study/tradeoff.h"

#include <algorithm>
#include <limits>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// By a sweep over rising cost: best of those that cost the same, and better than all that cost less.
std::vector<bool> FrontBySweep(const std::vector<TradeoffPoint>& points) {
  std::vector<bool> front;
  for (const TradeoffPoint& own : points) {
    double cheaper = std::numeric_limits<double>::infinity(), same = cheaper;
    for (const TradeoffPoint& other : points) {
      if (other.cost < own.cost) cheaper = std::min(cheaper, other.error);
      if (other.cost == own.cost) same = std::min(same, other.error);
    }
    front.push_back(own.error == same && own.error < cheaper);
  }
  return front;
}

TEST(Tradeoff, FrontOfRandomPointsWithTies) {
  Rng rng(3);
  for (int trial = 0; trial < 100; ++trial) {
    std::vector<TradeoffPoint> points;
    for (int i = 0; i < 20; ++i) {
      points.push_back({"p", static_cast<double>(rng.Index(8)), static_cast<double>(rng.Index(8))});
    }
    EXPECT_EQ(ParetoFront(points), FrontBySweep(points)) << trial;
  }
}

TEST(Tradeoff, WhatCouldNotBeDoneIsNotOnTheFrontAndBeatsNobody) {
  const std::vector<TradeoffPoint> points{{"a", 1, kNaN}, {"b", kNaN, 0}, {"c", 5, 5}, {"d", kNaN, kNaN}, {"e", 6, 5}};
  EXPECT_EQ(ParetoFront(points), std::vector<bool>({false, false, true, false, false}));
  EXPECT_TRUE(ParetoFront({}).empty());
}

TEST(Tradeoff, FiguresThatAreNoneAreShownAsADash) {
  EXPECT_EQ(Shown(1.25, 1), "1.2");
  EXPECT_EQ(Shown(kNaN, 1), "-");
  EXPECT_EQ(Shown(std::numeric_limits<double>::infinity(), 1), "-");
}

TEST(Tradeoff, ThePageStandsBesideWhatIsThere) {
  const TempDir folder;
  const std::string out = folder / "out";
  Put(out + "/notes.txt", "mine");
  const auto place = TradeoffPlace(out, "calibrate", {});
  const std::string written =
      WriteTradeoffPage({"calibrate", "Speed & accuracy", "All ways", "time (s)", "error (px)"},
                        {{"quick way", 1, 2}, {"careful way", 3, 1}, {"impossible way", kNaN, kNaN}}, out);
  EXPECT_EQ(written, out + "/tradeoff-calibrate.html");
  const std::string page = ReadFile(out + "/tradeoff-calibrate.html");
  for (const char* text : {"Speed &amp; accuracy", "quick way", "careful way", "time (s)", "error (px)"}) {
    EXPECT_THAT(page, HasSubstr(text));
  }
  EXPECT_THAT(page, Not(HasSubstr("impossible way")));
  EXPECT_EQ(ReadFile(out + "/notes.txt"), "mine");
}

TEST(Tradeoff, WithoutAFolderNothingIsTakenAndOthersFilesStay) {
  EXPECT_EQ(TradeoffPlace("", "pack", {}), nullptr);
  const TempDir folder;
  Put(folder / "out/tradeoff-pack.html", "mine");
  EXPECT_THAT(MessageOf<UsageError>([&] { TradeoffPlace(folder / "out", "pack", {}); }), HasSubstr("tradeoff-pack.html"));
  EXPECT_EQ(ReadFile(folder / "out/tradeoff-pack.html"), "mine");
  Put(folder / "data/picture.png", "x");
  EXPECT_THAT(MessageOf<UsageError>([&] { TradeoffPlace(folder / "data", "pack", {folder / "data"}); }),
              HasSubstr(folder / "data"));
}

}  // namespace
}  // namespace mvstudio::stages
