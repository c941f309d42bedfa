#include "stages/words.h"

#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <set>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

TEST(Words, TheFirstEqualsSignEndsTheName) {
  const auto [name, path] = SplitNamePath("option 'video'", "cam 1=a=b.mp4");
  EXPECT_EQ(name, "cam 1");
  EXPECT_EQ(path, "a=b.mp4");
}

TEST(Words, AWordWithoutNameOrPathIsRefusedByItself) {
  for (const std::string word : {"", "cam", "=a.mp4", "cam="}) {
    EXPECT_THAT(MessageOf<UsageError>([&] { SplitNamePath("option 'video'", word); }), HasSubstr("option 'video' " + word));
  }
  EXPECT_THAT(MessageOf<UsageError>([] { SplitNamePath("option 'video'", "\xff\xfe=a.mp4"); }), HasSubstr("UTF-8"));
}

TEST(Words, WhatWasProbablyMeantIsNamed) {
  EXPECT_THAT(MessageOf<UsageError>([] { SplitNamePath("option 'camera'", "img/left01.jpg"); }),
              HasSubstr("a pattern in quotes: option 'camera' cam_01='img/*.jpg'"));
  const mvstudio::testing::TempDir folder;
  for (const char* camera : {"cam02", "cam01"}) WriteFileAtomic(folder / camera + "/0_keypoints.json", "{}");
  const std::string refused = MessageOf<UsageError>([&] { SplitNamePath("option 'pose2d'", folder / ""); });
  EXPECT_THAT(refused, HasSubstr("e.g. option 'pose2d' cam_01=pose/cam01_json"));
  EXPECT_LT(refused.find("cam01=" + folder / "cam01"), refused.find("cam02=" + folder / "cam02"));
}

TEST(Words, ANamedPathIsWrittenAsItIsRead) {
  NamedPath named;
  FromString("cam 1=a=b.mp4", "video", &named);
  EXPECT_EQ(named.path, "a=b.mp4");
  EXPECT_EQ(ToString(named), "cam 1=a=b.mp4");
  EXPECT_THAT(MessageOf<UsageError>([&] { FromString("cam", "video", &named); }), HasSubstr("option 'video' cam: expected"));
}

TEST(Words, RangesComeSortedAndCountOnce) {
  EXPECT_EQ(ParseRanges("option 'frames'", "8-10,1,4,7-9"), std::vector<int>({1, 4, 7, 8, 9, 10}));
  EXPECT_EQ(RangesText({1, 4, 7, 8, 9, 10}), "1,4,7-10");
  EXPECT_EQ(RangesText({}), "");
}

TEST(Words, RangesTextReadsBackWithOneItemARun) {
  Rng rng(7);
  for (int trial = 0; trial < 300; ++trial) {
    const double share = rng.Uniform();
    std::set<int> numbers;
    for (int n = 0; n < 60; ++n) {
      if (rng.Uniform() < share) numbers.insert(n);
    }
    const std::vector<int> sorted(numbers.begin(), numbers.end());
    const std::string text = RangesText(sorted);
    EXPECT_EQ(ParseRanges("option 'frames'", text), sorted) << text;
    long runs = 0;
    for (const int n : sorted) runs += numbers.count(n - 1) == 0;
    const long commas = std::count(text.begin(), text.end(), ',');
    EXPECT_EQ(commas + (text.empty() ? 0 : 1), runs) << text;
  }
}

TEST(Words, NumbersThatAreNoneAndRangesThatAreTooLongAreRefused) {
  for (const std::string text : {"x", "1.5", " 1", "+1", "-1", "1-", "1--2", "3-2", "1,,2", "0-99999999", "99999999999"}) {
    EXPECT_THAT(MessageOf<UsageError>([&] { ParseRanges("option 'frames'", text); }), HasSubstr("option 'frames'")) << text;
  }
}

TEST(Words, LengthsHaveTheUnitOfTheirSize) {
  EXPECT_EQ(LengthText(0), "0.00 mm");
  EXPECT_EQ(LengthText(2.5e-9), "0.0025 um");
  EXPECT_EQ(LengthText(-4.2e-5), "-42 um");
  EXPECT_EQ(LengthText(1e-4), "0.10 mm");
  EXPECT_EQ(LengthText(0.01234), "12.34 mm");
  EXPECT_EQ(LengthText(3276.4), "3276.40 m");
  EXPECT_EQ(LengthText(std::nan("")), "unknown");
}

/// In a process of its own that may compute for a second: a loop that counts past the largest number never ends.
TEST(WordsDeathTest, TheLargestNumberIsANumberToo) {
  const auto parse = [] {
    const rlimit limit{1, 1};
    setrlimit(RLIMIT_CPU, &limit);
    const int largest = std::numeric_limits<int>::max();
    std::_Exit(ParseRanges("option 'frames'", std::to_string(largest)) == std::vector<int>{largest} ? 0 : 1);
  };
  EXPECT_EXIT(parse(), ::testing::ExitedWithCode(0), "");
}

TEST(Words, OneIsNoPlural) {
  EXPECT_EQ(Counted(0, "error") + ", " + Counted(1, "warning") + ", " + Counted(2, "warning"),
            "0 errors, 1 warning, 2 warnings");
}

}  // namespace
}  // namespace mvstudio::stages
