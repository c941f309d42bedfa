#include <cmath>
#include <limits>

#include "dataset/detect/tfjs/json_parse.h"
#include "dataset/detect/tfjs/weights.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::detect::internal {
namespace {

/// IEEE 754-2008, binary16: sign, 5 bits of exponent with bias 15, 10 bits of fraction.
double HalfByDefinition(int bits) {
  const int exponent = bits >> 10 & 31, fraction = bits & 1023;
  const double sign = bits >> 15 ? -1 : 1;
  if (exponent == 31) return fraction ? std::numeric_limits<double>::quiet_NaN() : sign * INFINITY;
  return sign * (exponent ? std::ldexp(1024 + fraction, exponent - 25) : std::ldexp(fraction, -24));
}

TEST(HalfToFloat, EveryNumberOfSixteenBits) {
  for (int bits = 0; bits < 1 << 16; ++bits) {
    const double value = HalfToFloat(static_cast<uint16_t>(bits)), expected = HalfByDefinition(bits);
    if (std::isnan(expected)) {
      EXPECT_TRUE(std::isnan(value)) << bits;
    } else {
      EXPECT_EQ(value, expected) << bits;
      EXPECT_EQ(std::signbit(value), std::signbit(expected)) << bits;
    }
  }
}

/// The examples of RFC 4648, section 10, and bytes that are no text.
TEST(DecodeBase64, GivesTheBytesThatWereEncoded) {
  const auto decoded = [](const std::string& text) { return DecodeBase64("graph.json", "node", text); };
  EXPECT_EQ(decoded(""), "");
  EXPECT_EQ(decoded("Zg=="), "f");
  EXPECT_EQ(decoded("Zm8="), "fo");
  EXPECT_EQ(decoded("Zm9v"), "foo");
  EXPECT_EQ(decoded("Zm9vYg=="), "foob");
  EXPECT_EQ(decoded("Zm9vYmE="), "fooba");
  EXPECT_EQ(decoded("Zm9vYmFy"), "foobar");
  EXPECT_EQ(decoded("AP/+gA=="), std::string("\x00\xff\xfe\x80", 4));
}

TEST(DecodeBase64, RefusesWhatIsNone) {
  for (const std::string text : {"Zg", "Zg=", "Zg===", "====", "Z===", "Zm9*", "Zm 9v", "=Zm9", "Zm=v", "Zm9_", "Zm9-"}) {
    EXPECT_THAT(MessageOf<FormatError>([&] { DecodeBase64("graph.json", "node", text); }),
                HasSubstr("graph.json: node: is not base64"))
        << text;
  }
}

}  // namespace
}  // namespace mvstudio::detect::internal
