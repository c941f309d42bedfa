#include "core/format.h"

#include <gtest/gtest.h>

#include <string>

namespace mvstudio {
namespace {

TEST(Format, IsPrintf) {
  EXPECT_EQ(Format("none"), "none");
  EXPECT_EQ(Format("%s", ""), "");
  EXPECT_EQ(Format("%-5s|%+.2f %% of %03d", "ab", 1.005, 7), "ab   |+1.00 % of 007");
  EXPECT_EQ(Format("%.*g", 3, 1234.5), "1.23e+03");
}

TEST(Format, HasNoLimit) {
  for (const size_t size : {254u, 255u, 256u, 257u, 100'000u}) {
    const std::string text(size, 'x');
    EXPECT_EQ(Format("%s", text.c_str()), text) << size;
    EXPECT_EQ(Format("%s!", text.c_str()), text + "!") << size;
  }
}

}  // namespace
}  // namespace mvstudio
