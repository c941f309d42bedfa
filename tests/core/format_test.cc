#include "core/format.h"

#include <string>

#include "core/text/short_numbers.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

TEST(ShortNumbers, OfAbsurdLengthOnly) {
  EXPECT_EQ(ShortNumbers(Format("sigma %.1f px", 1e300)), "sigma 1e+300 px");
  EXPECT_EQ(ShortNumbers(Format("off by (%.0f, %f)", -1e300, 2.5)), "off by (-1e+300, 2.500000)");
  EXPECT_EQ(ShortNumbers("is " + std::to_string(1e22) + " long"), "is 1e+22 long");
  for (const char* same :
       {"12345678901234567890.5", "a/1234567890123456789012345.png", "sha 00f1234567890123456789012345678901234",
        "20261127123456789012345678", "", "7", "x1234567890123456789012345678901234567890123456"})
    EXPECT_EQ(ShortNumbers(same), same);
}

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
