#include "core/utf8.h"

#include <string>

#include "tests/support/test.h"

namespace mvstudio {
namespace {

TEST(Utf8, WellFormedTexts) {
  EXPECT_TRUE(IsUtf8(""));
  EXPECT_TRUE(IsUtf8("camera 1"));
  EXPECT_TRUE(IsUtf8("\xc2\x80\xdf\xbf\xe0\xa0\x80\xed\x9f\xbf\xef\xbf\xbf\xf0\x90\x80\x80\xf4\x8f\xbf\xbf"));
  EXPECT_EQ(Utf8Length("\xf0\x9f\x8e\xa5", 0), 4u);
  EXPECT_EQ(Utf8Length("a", 1), 0u);
}

TEST(Utf8, WhatIsNone) {
  for (const std::string text : {"\x80", "\xc0\x80", "\xc1\xbf", "\xc3", "\xc3(", "\xe0\x9f\xbf", "\xed\xa0\x80", "\xe2\x82",
                                 "\xf0\x8f\xbf\xbf", "\xf4\x90\x80\x80", "\xf5\x80\x80\x80", "\xff", "ok\xfe"}) {
    EXPECT_FALSE(IsUtf8(text)) << text;
  }
}

}  // namespace
}  // namespace mvstudio
