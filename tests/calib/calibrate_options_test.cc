#include "calib/calibrate_options.h"

#include "core/error.h"
#include "tests/support/test.h"

/// Options of Calibrate and their words.
namespace mvstudio::calib {
namespace {

/// What the option is after a word.
template <class T>
T Read(const std::string& text) {
  T value{};
  SetFromString(text, "name", &value);
  return value;
}

template <class T>
void ExpectRoundTrip(const std::vector<std::string>& texts) {
  for (const std::string& text : texts) EXPECT_EQ(ToString(Read<T>(text)), text);
}

template <class T>
void ExpectRefused(const std::vector<std::string>& texts) {
  for (const std::string& text : texts) EXPECT_THROW(Read<T>(text), UsageError) << text;
}

TEST(CalibrateOptions, WordsAreWrittenAsTheyAreRead) {
  ExpectRoundTrip<std::optional<geometry::LensModel>>({"auto", "pinhole", "brown4", "splined"});
  ExpectRoundTrip<LensSharing>({"auto", "none", "all", "a,b;c,d", "a", "a,b"});
  ExpectRoundTrip<TimeOffsetChoice>({"auto", "on", "none"});
  ExpectRoundTrip<WorldOrigin>({"camera", "camera:left", "camera:a:b", "board:4"});
  ExpectRoundTrip<HoldoutRule>({"every:4", "every:4:0", "every:2"});
  ExpectRoundTrip<CameraSplit>({"cam:82", "cam:82:lens", "a:b:7", "lens:0"});
  ExpectRoundTrip<HeldPart>({"lenses", "poses", "lenses:a", "poses:a,b", "lenses:"});
  ExpectRoundTrip<Engine>({"mvstudio", "mrcal"});
}

TEST(CalibrateOptions, OtherWordsAreRefused) {
  ExpectRefused<std::optional<geometry::LensModel>>({"brown9", ""});
  ExpectRefused<TimeOffsetChoice>({"perhaps", "off"});
  ExpectRefused<WorldOrigin>({"board", "board:", "board:x", "board:-1", "board:1234567890", "moon"});
  ExpectRefused<HoldoutRule>({"every", "every:1", "every:4:4", "every:4:", "every:4:-1", "every:4:1:2", "3"});
  ExpectRefused<CameraSplit>({"cam", "cam:", "cam:x", "cam:82:lenses", ":lens"});
  ExpectRefused<HeldPart>({"lens", "", "boards:a"});
  ExpectRefused<Engine>({"other"});
}

TEST(CalibrateOptions, RulesSayWhatTheirWordsSay) {
  EXPECT_EQ(Read<HoldoutRule>("every:4").first, 3);
  EXPECT_EQ(Read<HoldoutRule>("every:4:1").first, 1);
  EXPECT_EQ(ToString(HoldoutRule()), "");
  EXPECT_EQ(Read<WorldOrigin>("camera:").camera, "");
  EXPECT_EQ(Read<CameraSplit>("a:b:7:lens").camera, "a:b");
  EXPECT_THAT(Read<LensSharing>("a,b;c").groups,
              ::testing::ElementsAre(std::vector<std::string>{"a", "b"}, std::vector<std::string>{"c"}));
}

TEST(CalibrateOptions, TheRefusalNamesOptionAndWord) {
  try {
    Read<Engine>("other");
    ADD_FAILURE() << "taken";
  } catch (const UsageError& error) {
    EXPECT_STREQ(error.what(), "option 'engine' other: expected mvstudio or mrcal");
  }
}

}  // namespace
}  // namespace mvstudio::calib
