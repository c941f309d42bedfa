#include "core/disk/npy.h"

#include <cmath>
#include <cstring>

#include "core/disk/npy_write.h"
#include "core/error.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

/// As numpy.save writes it: the header padded so that the data begin at a multiple of 64 bytes.
std::string Npy(const std::string& descr, const std::string& shape, const std::string& data, bool fortran = false) {
  std::string header =
      "{'descr': '" + descr + "', 'fortran_order': " + (fortran ? "True" : "False") + ", 'shape': " + shape + ", }";
  while ((10 + header.size() + 1) % 64) header += ' ';
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(header.size() & 0xff);
  bytes += static_cast<char>(header.size() >> 8);
  return bytes + header + data;
}

template <class T>
std::string Bytes(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

TEST(Npy, ReadsEveryNumberType) {
  const std::vector<double> expected = {0, 1, 2, 3, 4, 5};
  const auto check = [&](const std::string& descr, const std::string& data) {
    const NpyArray a = ParseNpy(Npy(descr, "(2, 3)", data), "x.npy");
    EXPECT_EQ(a.shape, (std::vector<int64_t>{2, 3})) << descr;
    EXPECT_EQ(a.values, expected) << descr;
  };
  check("<f8", Bytes<double>({0, 1, 2, 3, 4, 5}));
  check("<f4", Bytes<float>({0, 1, 2, 3, 4, 5}));
  check("<f2", Bytes<uint16_t>({0x0000, 0x3c00, 0x4000, 0x4200, 0x4400, 0x4500}));
  check("<i8", Bytes<int64_t>({0, 1, 2, 3, 4, 5}));
  check("<u2", Bytes<uint16_t>({0, 1, 2, 3, 4, 5}));
  check("|u1", Bytes<uint8_t>({0, 1, 2, 3, 4, 5}));
}

TEST(Npy, FortranOrderBecomesRows) {
  const NpyArray a = ParseNpy(Npy("<f4", "(2, 3)", Bytes<float>({0, 3, 1, 4, 2, 5}), true), "x.npy");
  EXPECT_EQ(a.values, (std::vector<double>{0, 1, 2, 3, 4, 5}));
}

TEST(Npy, ScalarsVectorsAndEmptyArrays) {
  EXPECT_EQ(ParseNpy(Npy("<f8", "()", Bytes<double>({7})), "x").values, (std::vector<double>{7}));
  EXPECT_EQ(ParseNpy(Npy("<f8", "(2,)", Bytes<double>({7, 8})), "x").shape, (std::vector<int64_t>{2}));
  EXPECT_TRUE(ParseNpy(Npy("<f8", "(0, 5)", ""), "x").values.empty());
}

TEST(Npy, HalfExtremes) {
  const NpyArray a = ParseNpy(Npy("<f2", "(4,)", Bytes<uint16_t>({0x7bff, 0x0001, 0xfc00, 0x7e00})), "x");
  EXPECT_EQ(a.values[0], 65504);
  EXPECT_EQ(a.values[1], std::ldexp(1.0, -24));
  EXPECT_TRUE(std::isinf(a.values[2]) && a.values[2] < 0);
  EXPECT_TRUE(std::isnan(a.values[3]));
}

TEST(Npy, RefusesWhatItCannotRead) {
  const std::string good = Npy("<f4", "(2, 3)", Bytes<float>({0, 1, 2, 3, 4, 5}));
  for (size_t cut = 0; cut < good.size(); ++cut) EXPECT_THROW(ParseNpy(good.substr(0, cut), "x"), FormatError) << cut;
  EXPECT_THROW(ParseNpy(Npy("|O", "(1,)", "abc"), "x"), FormatError);
  EXPECT_THROW(ParseNpy(Npy(">f8", "(1,)", Bytes<double>({1})), "x"), FormatError);
  EXPECT_THROW(ParseNpy(Npy("<c8", "(1,)", Bytes<double>({1})), "x"), FormatError);
  EXPECT_THROW(ParseNpy(Npy("<f8", "(4611686018427387904, 4)", Bytes<double>({1})), "x"), FormatError);
  EXPECT_THROW(ParseNpy(Npy("<f8", "(1000000, 1000000, 1000000, 1000000)", Bytes<double>({1})), "x"), FormatError);
  EXPECT_THROW(ParseNpy(Npy("<f8", "(-1,)", Bytes<double>({1})), "x"), FormatError);
  EXPECT_THROW(ParseNpy(Npy("<f8", "[1]", Bytes<double>({1})), "x"), FormatError);
  EXPECT_THROW(ReadNpy("/does/not/exist.npy"), IoError);
}

TEST(NpyWrite, HeaderIsPaddedTo64) {
  using ::testing::HasSubstr;
  const std::string bytes = NpyOfDoubles({2, 3}, {1, 2, 3, 4, 5, 6});
  EXPECT_EQ(bytes.substr(0, 8), std::string("\x93NUMPY\x01\x00", 8));
  EXPECT_EQ(bytes.size() % 64, 48u);  // whole 64 and six doubles
  EXPECT_THAT(bytes, HasSubstr("'shape': (2, 3)"));
  EXPECT_THAT(NpyOfDoubles({1}, {4}), HasSubstr("'shape': (1,)"));
  EXPECT_THROW(NpyOfDoubles({2}, {1}), ContractViolation);
  EXPECT_THROW(NpyOfTexts({"\xff"}), UsageError);
}

TEST(NpyWrite, NumbersComeBack) {
  EXPECT_EQ(ParseNpy(NpyOfFloats({2}, {0.1f, -3e38f}), "x").values, (std::vector<double>{0.1f, -3e38f}));
  EXPECT_EQ(ParseNpy(NpyOfInts({1, 2}, {-1, int64_t{1} << 50}), "x").values, (std::vector<double>{-1, 1125899906842624.0}));
}

TEST(NpyWrite, TextsComeBack) {
  const std::vector<std::string> texts = {"a", "", "ähnlich", "\xf0\x9f\x93\xb7 \xe2\x82\xac"};
  EXPECT_EQ(ParseNpyTexts(NpyOfTexts(texts), "x"), texts);
  EXPECT_TRUE(ParseNpyTexts(NpyOfTexts({}), "x").empty());
}

TEST(Npy, RefusesTextsThatItCannotRead) {
  const std::string good = NpyOfTexts({"ab", "c"}), data(8, '\0');
  EXPECT_EQ(ParseNpyTexts(Npy("<U2", "(1,)", data), "x"), (std::vector<std::string>{""}));
  for (size_t cut = 0; cut < good.size(); ++cut) EXPECT_THROW(ParseNpyTexts(good.substr(0, cut), "x"), FormatError) << cut;
  for (const char* descr : {"<U", ">U2", "|S8", "<f8", "<U99999999999999999999", "<U65537"})
    EXPECT_THROW(ParseNpyTexts(Npy(descr, "(1,)", data), "x"), FormatError) << descr;
  EXPECT_THROW(ParseNpyTexts(Npy("<U2", "(2,)", data), "x"), FormatError);
  EXPECT_THROW(ParseNpyTexts(Npy("<U1", "(1, 2)", data), "x"), FormatError);
  EXPECT_THROW(ParseNpyTexts(Npy("<U0", "(1000000000,)", data), "x"), FormatError);
  EXPECT_THROW(ParseNpyTexts(Npy("<U1", "(1,)", Bytes<uint32_t>({0xd800})), "x"), FormatError);
  EXPECT_THROW(ParseNpyTexts(Npy("<U1", "(1,)", Bytes<uint32_t>({0x110000})), "x"), FormatError);
  EXPECT_THROW(ParseNpy(good, "x"), FormatError);
}

}  // namespace
}  // namespace mvstudio
