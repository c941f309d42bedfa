#include "core/label.h"

#include "tests/support/test.h"

namespace mvstudio {
namespace {

TEST(Label, WhatANameMayHold) {
  for (const char* good : {"cam_01", "00_00", "été 🙂", "a/b", "..", "-x", "\xc2\xa0"})
    EXPECT_EQ(WhyNotALabel(good), "") << good;
  EXPECT_EQ(WhyNotALabel(""), "is empty");
  EXPECT_EQ(WhyNotALabel(std::string(200, 'x')), "");
  EXPECT_EQ(WhyNotALabel(std::string(201, 'x')), "is longer than 200 bytes");
  EXPECT_EQ(WhyNotALabel("abc", 2), "is longer than 2 bytes");
  for (const std::string& bad : {std::string("a\x1b[2J"), std::string("a\nb"), std::string("a\0b", 3), std::string("\x7f"),
                                 std::string("a\xc2\x9b"
                                             "31m")}) {
    EXPECT_EQ(WhyNotALabel(bad), "holds a control character");
  }
  for (const char* bad : {"a\xc3", "\xed\xa0\x80", "\xff"}) EXPECT_EQ(WhyNotALabel(bad), "is not UTF-8");
}

}  // namespace
}  // namespace mvstudio
