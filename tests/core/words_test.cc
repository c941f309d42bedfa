#include "core/text/words.h"

#include <gtest/gtest.h>

#include <set>

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

std::vector<int> Known(const std::vector<int>& asked) {
  const std::set<int> there = {0, 12, 24, 36};
  return KnownFrames(
      asked, [&](int frame) { return there.count(frame) > 0; },
      [](int frame) { throw UsageError("frame " + std::to_string(frame)); });
}

TEST(KnownFrames, ARangeTakesWhatThereIs) {
  EXPECT_EQ(Known({10, 11, 12, 13, 14}), std::vector<int>{12});
  EXPECT_EQ(Known({24, 0, 24}), (std::vector<int>{0, 24}));
  EXPECT_TRUE(Known({}).empty());
  EXPECT_THROW(Known({0, 5}), UsageError);
  EXPECT_THROW(Known({0, 13, 14, 15}), UsageError);
}

}  // namespace
}  // namespace mvstudio
