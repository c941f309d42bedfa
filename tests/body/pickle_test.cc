#include "dataset/arrays/pickle.h"

#include "core/error.h"
#include "tests/body/pickle_bytes.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

using namespace std::string_literals;

using pickle_bytes::Array;
using pickle_bytes::Dict;
using pickle_bytes::Int;
using pickle_bytes::Short;

std::string Sparse(int rows) {
  const std::string shape = Int(rows) + Int(2) + "\x86"s;
  return "ccopy_reg\n_reconstructor\n(cscipy.sparse.csc\ncsc_matrix\nc__builtin__\nobject\nNtR}("s + Short("_shape") + shape +
         Short("data") + Array("K\2\x85", {5, 7}) + Short("indices") + Array("K\2\x85", {2, 0}) + Short("indptr") +
         Array("K\3\x85", {0, 1, 2}) + "ub"s;
}

TEST(Pickle, ReadsArraysSparseMatricesAndChumpy) {
  const std::string chumpy =
      "ccopy_reg\n_reconstructor\n(cchumpy.ch\nCh\nc__builtin__\nobject\nNtR}("s + Short("x") + Array("K\1\x85", {4}) + "ub"s;
  const auto arrays =
      dataset::ArraysFromPickle(Dict(Short("a") + Array("K\2K\3\x86", {1, 2, 3, 4, 5, 6}) + Short("s") + Sparse(3) +
                                     Short("c") + chumpy + Short("text") + Short("female") + Short("n") + "N"),
                                "a.pkl");
  ASSERT_EQ(arrays.size(), 3u);
  EXPECT_EQ(arrays.at("a").shape, (std::vector<int64_t>{2, 3}));
  EXPECT_EQ(arrays.at("a").values, (std::vector<double>{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(arrays.at("s").shape, (std::vector<int64_t>{3, 2}));
  EXPECT_EQ(arrays.at("s").values, (std::vector<double>{0, 7, 0, 0, 5, 0}));
  EXPECT_EQ(arrays.at("c").values, std::vector<double>{4});
}

TEST(Pickle, ReadsProtocolZero) {
  const std::string text =
      "(dp0\nS'a'\np1\ncnumpy.core.multiarray\n_reconstruct\np2\n(cnumpy\nndarray\np3\n(I0\ntp4\nS'b'\np5\ntp6\nRp7\n(I1\n(I2\n"
      "tp8\ncnumpy\ndtype\np9\n(S'u1'\np10\nI0\nI1\ntp11\nRp12\n(I3\nS'|'\np13\nNNNI-1\nI-1\nI0\ntp14\nbI00\nS'\\x07A'\np15\n"
      "tp16\nbs.";
  const auto arrays = dataset::ArraysFromPickle(text, "a.pkl");
  ASSERT_EQ(arrays.count("a"), 1u);
  EXPECT_EQ(arrays.at("a").values, (std::vector<double>{7, 65}));
}

std::string Refusal(const std::string& bytes) {
  return mvstudio::testing::MessageOf<FormatError>([&] { dataset::ArraysFromPickle(bytes, "a.pkl"); });
}

TEST(Pickle, RefusesFunctionsByName) {
  EXPECT_NE(Refusal("cos\nsystem\n(S'true'\ntR.").find("names 'os.system'"), std::string::npos);
  EXPECT_NE(Refusal("\x80\4\x8c\10builtins\x8c\4eval\x93."s).find("names 'builtins.eval'"), std::string::npos);
  EXPECT_NE(Refusal("cnumpy\nload\n.").find("numpy.load"), std::string::npos);
  EXPECT_NE(Refusal("cnumpy\nndarray.tofile\n.").find("numpy.ndarray.tofile"), std::string::npos);
  EXPECT_NE(Refusal("\x80\2c__builtin__\nobject\n)R."s).find("byte"), std::string::npos);
  EXPECT_NE(Refusal("(ios\nsystem\n.").find("step"), std::string::npos);  // INST
  EXPECT_NE(Refusal("P1\n.").find("step"), std::string::npos);            // a persistent name
}

TEST(Pickle, RefusesDamage) {
  for (const std::string& bytes : {""s,
                                   "."s,
                                   "N"s,
                                   "N."s,
                                   "h\1."s,
                                   "t."s,
                                   "0."s,
                                   "(1."s,
                                   "U\5abc"s,
                                   "X\xff\xff\xff\xff"s,
                                   "\x8d\xff\xff\xff\xff\xff\xff\xff\xffx"s,
                                   "\x80\11."s,
                                   "I1x\n."s,
                                   "S'a\n."s,
                                   "]N\x86"
                                   "b."s,
                                   "}(Nu."s,
                                   "Na."s,
                                   "(Np0\n."s,
                                   "\x8a\xff."s,
                                   "N(0."s}) {
    EXPECT_NE(Refusal(bytes).find("a.pkl"), std::string::npos) << ::testing::PrintToString(bytes);
  }
}

TEST(Pickle, RefusesArraysThatDoNotFit) {
  EXPECT_NE(Refusal(Dict(Short("a") + Array("K\7\x85", {1, 2}))).find("a.pkl: a"), std::string::npos);
  EXPECT_NE(Refusal(Dict(Short("a") + Array("N", {1, 2}))).find("a.pkl: a"), std::string::npos);
  EXPECT_NE(Refusal(Dict(Short("a") + Array("J\xff\xff\xff\xff\x85", {1}))).find("a.pkl: a"), std::string::npos);
  EXPECT_NE(Refusal(Dict(Short("s") + Sparse(2))).find("s.indices"), std::string::npos);
  EXPECT_NE(Refusal(Dict(Short("a") + "cnumpy.core.multiarray\n_reconstruct\n)R")).find("a.pkl: a"), std::string::npos);
}

TEST(Pickle, CutsAnywhereAreRefused) {
  const std::string whole = Dict(Short("a") + Array("K\2\x85", {1, 2}) + Short("s") + Sparse(3));
  for (size_t size = 0; size < whole.size(); ++size)
    EXPECT_THROW(dataset::ArraysFromPickle(whole.substr(0, size), "a.pkl"), FormatError);
}

/// A tuple of a tuple of …, and a list that holds itself: nothing runs along them.
TEST(Pickle, DepthAndCirclesDoNoHarm) {
  EXPECT_TRUE(dataset::ArraysFromPickle(Dict(Short("a") + "N" + std::string(100000, '\x85')), "a.pkl").empty());
  EXPECT_TRUE(dataset::ArraysFromPickle("\x80\2}q\1U\1ah\1s."s, "a.pkl").empty());
  EXPECT_THROW(dataset::ArraysFromPickle("N" + std::string(5'000'000, '2'), "a.pkl"), FormatError);
}

}  // namespace
}  // namespace mvstudio::body
