#include "core/text/shell_word.h"
#include "core/text/words.h"

#include <gtest/gtest.h>


#include "core/choice/frame_choice.h"
#include "core/error.h"

namespace mvstudio {
namespace {

TEST(Words, CaseAndHyphensDoNotCount) {
  EXPECT_EQ(PlainWord("OpenCV"), PlainWord("open_cv"));
  EXPECT_EQ(PlainWord("motion-energy"), PlainWord("Motion Energy"));
  EXPECT_NE(PlainWord("brown4"), PlainWord("brown5"));
}

TEST(Words, TheNearestIsNamed) {
  const std::vector<std::string> known = {"mvstudio", "panoptic", "kalibr"};
  EXPECT_EQ(NearestWord("Calibr", known), "kalibr");
  EXPECT_EQ(NearestWord("panotpic", known), "panoptic");
  EXPECT_EQ(NearestWord("colmap", known), "");
  EXPECT_EQ(NearestWord(std::string(200, 'k'), known), "");
}

std::vector<int> Known(const std::vector<int>& asked) { return KnownFrames("f", asked, {0, 12, 24, 36}, "x").frames; }

std::string Beyond(const std::vector<int>& asked, const std::vector<int>& there) {
  return KnownFrames("option 'frames'", asked, there, "walk.trc").beyond;
}

TEST(ShellWord, IsReadBackAsItWas) {
  EXPECT_EQ(ShellWord("cams/a-1.json"), "cams/a-1.json");
  EXPECT_EQ(ShellWord("my cams/a.json"), "'my cams/a.json'");
  EXPECT_EQ(ShellWord("it's"), "'it'\\''s'");
  EXPECT_EQ(ShellWord(""), "''");
  for (const char c : std::string(" \t*?$&;|<>(){}[]\"`~#!\\^")) EXPECT_EQ(ShellWord(std::string("a") + c).front(), '\'') << c;
}

TEST(KnownFrames, ARangeTakesWhatThereIs) {
  EXPECT_EQ(Known({10, 11, 12, 13, 14}), std::vector<int>{12});
  EXPECT_EQ(Known({24, 0, 24}), (std::vector<int>{0, 24}));
  EXPECT_TRUE(Known({}).empty());
  EXPECT_THROW(Known({0, 5}), UsageError);
  EXPECT_THROW(Known({0, 13, 14, 15}), UsageError);
  EXPECT_THROW(Known({5}), NothingLeftError);
  EXPECT_THROW(Known({40, 41}), NothingLeftError);
  EXPECT_THROW(KnownFrames("f", {1}, {}, "x"), NothingLeftError);
}

TEST(KnownFrames, WhatLiesBeyondIsSaid) {
  EXPECT_EQ(Beyond({2, 3}, {1, 2, 3}), "");
  EXPECT_EQ(Beyond({2, 3, 4, 5}, {1, 2, 3}),
            "option 'frames': walk.trc has no frames 4 to 5; it has 3 frames from 1 to 3, which are used as far as asked for");
  EXPECT_EQ(Beyond({0, 1}, {1, 2, 3}).substr(0, 39), "option 'frames': walk.trc has no frame ");
  // Thinned out: 11 was never filmed, 15 would have been the next.
  EXPECT_EQ(Beyond({9, 10, 11}, {0, 5, 10}), "");
  EXPECT_NE(Beyond({9, 10, 11, 12, 13, 14, 15}, {0, 5, 10}), "");
}

}  // namespace
}  // namespace mvstudio
