#include "core/fields.h"

#include "core/choice/auto_on_off.h"
#include "core/error.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

enum class Speed { kSlow, kFast, kUnnamed };
enum class Wordless { kOne };
constexpr ChoiceWords<Speed, 2> kSpeeds = {{{Speed::kSlow, "slow"}, {Speed::kFast, "fast"}}};

void FromString(const std::string& text, Speed* speed) {
  *speed = KnownChoice(kSpeeds, text, "option 'speed' is slow or fast, not " + text);
}

TEST(ChoiceWords, WordsAndChoicesNameEachOther) {
  for (const auto& [speed, word] : kSpeeds) {
    EXPECT_EQ(WordOf(kSpeeds, speed), word);
    EXPECT_EQ(ChoiceOf(kSpeeds, word), speed);
  }
  EXPECT_EQ(WordOf(kSpeeds, Speed::kUnnamed), "");
  for (const char* wrong : {"", "Slow", "slo", "slower"}) EXPECT_EQ(ChoiceOf(kSpeeds, wrong), std::nullopt) << wrong;
}

TEST(ChoiceWords, AnUnknownWordLeavesTheChoiceAsItIs) {
  Speed speed = Speed::kFast;
  EXPECT_THROW(FromString("warp", &speed), UsageError);
  EXPECT_EQ(speed, Speed::kFast);
  FromString("slow", &speed);
  EXPECT_EQ(speed, Speed::kSlow);
}

TEST(ChoiceWords, OnlyWhatIsReadFromWordsHasWords) {
  EXPECT_TRUE(kHasWords<Speed>);
  EXPECT_FALSE(kHasWords<Wordless>);
  EXPECT_FALSE(kHasWords<int>);
  EXPECT_FALSE(kHasWords<std::string>);
}

TEST(AutoOnOff, TheRefusalNamesTheOption) {
  EXPECT_TRUE(kHasSharedWords<AutoOnOff>);
  EXPECT_FALSE(kHasWords<AutoOnOff>);
  EXPECT_FALSE(kHasSharedWords<Speed>);
  AutoOnOff choice = AutoOnOff::kOff;
  for (const char* word : {"auto", "on", "off"}) {
    SetFromString(word, "warp", &choice);
    EXPECT_EQ(ToString(choice), word);
  }
  try {
    SetFromString("maybe", "warp", &choice);
    ADD_FAILURE() << "taken";
  } catch (const UsageError& error) {
    EXPECT_STREQ(error.what(), "option 'warp' maybe: expected auto, on or off");
  }
  EXPECT_EQ(choice, AutoOnOff::kOff);
}

}  // namespace
}  // namespace mvstudio
