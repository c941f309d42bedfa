#include "core/status.h"

#include <set>
#include <string>

#include "core/check.h"
#include "core/units.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

TEST(Status, NamesGoBothWaysAndAreDistinct) {
  std::set<std::string> names;
  for (int i = 0; i <= static_cast<int>(Status::kUndefined); ++i) {
    const auto status = static_cast<Status>(i);
    EXPECT_NE(ToString(status), "Unknown");
    EXPECT_EQ(StatusFromString(ToString(status)), status);
    EXPECT_TRUE(names.insert(std::string(ToString(status))).second);
  }
  EXPECT_EQ(ToString(Status::kOk), "Ok");
  EXPECT_FALSE(StatusFromString("ok"));
  EXPECT_FALSE(StatusFromString("Unknown"));
}

TEST(Check, MessageHoldsPlaceConditionAndValues) {
  const int views = 1;
  EXPECT_NO_THROW(MVS_CHECK(views == 1, "never"));
  try {
    MVS_CHECK(views >= 2, "got " << views << " views");
    FAIL() << "nothing was thrown";
  } catch (const ContractViolation& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("status_test.cc:"), std::string::npos);
    EXPECT_NE(text.find("views >= 2"), std::string::npos);
    EXPECT_NE(text.find("got 1 views"), std::string::npos);
  }
}

TEST(Errors, NameFileAndPlace) {
  const FormatError error("a.json", "cameras[3].K[1][2]", "a number was expected");
  EXPECT_STREQ(error.what(), "a.json: cameras[3].K[1][2]: a number was expected");
  EXPECT_EQ(error.where(), "cameras[3].K[1][2]");
  EXPECT_STREQ(FormatError("a.json", "", "empty").what(), "a.json: empty");
  EXPECT_STREQ(IoError("b", "cannot open").what(), "b: cannot open");
}

TEST(Units, DegreesAndRadians) {
  EXPECT_DOUBLE_EQ(DegToRad(180), kPi);
  EXPECT_DOUBLE_EQ(RadToDeg(DegToRad(12.5)), 12.5);
}

}  // namespace
}  // namespace mvstudio
