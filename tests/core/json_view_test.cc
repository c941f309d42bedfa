#include "core/json_view.h"

#include <nlohmann/json.hpp>

#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

template <class Json>
class JsonView : public ::testing::Test {};
using Kinds = ::testing::Types<nlohmann::json, nlohmann::ordered_json>;
TYPED_TEST_SUITE(JsonView, Kinds);

TYPED_TEST(JsonView, ReadsWhatIsThere) {
  const std::string path = "f";
  const auto json = TypeParam::parse(R"({"a": {"b": [1, -2.5, 3]}, "n": "-12", "t": true, "s": "x"})");
  const BasicJsonView<TypeParam> view(path, json);
  EXPECT_TRUE(view.Has("a"));
  EXPECT_FALSE(view.Has("b"));
  EXPECT_EQ(view["a"]["b"].Numbers(), (std::vector<double>{1, -2.5, 3}));
  EXPECT_EQ(view["a"]["b"][1].Number(), -2.5);
  EXPECT_EQ(view["a"]["b"][2].Int(), 3);
  EXPECT_EQ(view["a"]["b"][2].LongInt(), 3);
  EXPECT_EQ(view["n"].LongInt(), -12);
  EXPECT_TRUE(view["t"].Flag());
  EXPECT_EQ(view["s"].Text(), "x");
  EXPECT_EQ(view["a"]["b"][2].where(), "a.b[2]");
  EXPECT_EQ(view["a"].Entry("c", json["s"]).where(), "a.c");
  EXPECT_EQ(view["a"].Named("the weight")["b"].where(), "the weight.b");
  EXPECT_EQ(view["a"]["b"][2].PlainInt(), 3);
  EXPECT_EQ(view.AtPointer("/a/b/2").Int(), 3);
  EXPECT_EQ(view.AtPointer("/a/b")[2].where(), "/a/b[2]");
  EXPECT_TRUE(view.HasPointer("/a/b"));
  EXPECT_FALSE(view.HasPointer("/s/b"));
}

TYPED_TEST(JsonView, SaysWhatIsWrongWhere) {
  const std::string path = "f";
  const auto json =
      TypeParam::parse(R"({"a": [1, "x", 2.5, 1e300, null], "o": {}, "n": ["1.5", "1234567890123456", "-", ""]})");
  const BasicJsonView<TypeParam> view(path, json);
  const auto says = [&](const auto& read) { return MessageOf<FormatError>([&] { read(view); }); };
  EXPECT_EQ(says([](const auto& v) { v["b"]; }), "f: b: is missing");
  EXPECT_EQ(says([](const auto& v) { v["o"]["b"]; }), "f: o.b: is missing");
  EXPECT_EQ(says([](const auto& v) { v["a"]["b"]; }), "f: a: must be an object");
  EXPECT_EQ(says([](const auto& v) { v["a"][9]; }), "f: a[9]: is missing");
  EXPECT_EQ(says([](const auto& v) { v.AtPointer("/o/b"); }), "f: /o/b: is missing");
  EXPECT_EQ(says([](const auto& v) { v.AtPointer("/a/1").Int(); }), "f: /a/1: must be a number");
  EXPECT_EQ(says([](const auto& v) { v["o"][size_t{0}]; }), "f: o: must be a list");
  EXPECT_EQ(says([](const auto& v) { v["a"].Numbers(); }), "f: a[1]: must be a number");
  EXPECT_EQ(says([](const auto& v) { v["a"][4].Number(); }), "f: a[4]: must be a number");
  EXPECT_EQ(says([](const auto& v) { v["a"][2].Int(); }), "f: a[2]: must be a whole number");
  EXPECT_EQ(says([](const auto& v) { v["a"][3].Int(); }), "f: a[3]: must be a whole number");
  EXPECT_EQ(says([](const auto& v) { v["a"][3].LongInt(); }), "f: a[3]: must be a whole number");
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(says([i](const auto& v) { v["n"][i].LongInt(); }), "f: n[" + std::to_string(i) + "]: must be a whole number");
  }
  EXPECT_EQ(says([](const auto& v) { v["a"][size_t{0}].Text(); }), "f: a[0]: must be a text");
  EXPECT_EQ(says([](const auto& v) { v["a"][size_t{0}].Flag(); }), "f: a[0]: must be true or false");
}

TYPED_TEST(JsonView, PlainIntsAreWrittenAsSuch) {
  const std::string path = "f";
  const auto json = TypeParam::parse(R"([3.0, 2147483648, 1e3, -2147483647])");
  const BasicJsonView<TypeParam> view(path, json);
  EXPECT_EQ(view[size_t{0}].Int(), 3);
  EXPECT_EQ(view[3].PlainInt(), -2147483647);
  for (size_t i = 0; i < 3; ++i)
    EXPECT_EQ(MessageOf<FormatError>([&] { view[i].PlainInt(); }), "f: [" + std::to_string(i) + "]: must be a whole number");
}

TYPED_TEST(JsonView, BrokenTextsSayWhatIsWrongWhere) {
  const auto says = [](const std::string& text) {
    return MessageOf<FormatError>([&] { JsonFromText<TypeParam>(text, {4, true}, "f"); });
  };
  EXPECT_EQ(JsonFromText<TypeParam>("[1]", {4, true}, "f")[0], 1);
  EXPECT_EQ(says("[[[[[1]]]]]"), "f: is nested deeper than 4 levels");
  EXPECT_EQ(says(R"({"a": {"b\n": 1, "b\n": 2}})"), R"(f: a: the key 'b\n' is there twice)");
  const auto says_at_byte = [&](const std::string& text, const std::string& what) {
    const std::string message = says(text);
    EXPECT_EQ(message.rfind("f: byte ", 0), 0u) << message;
    EXPECT_NE(message.find(": " + what), std::string::npos) << message;
  };
  says_at_byte("[1e400]", "the number is beyond the range of doubles");
  says_at_byte("[1,", "is not valid JSON; cut short or damaged?");
  says_at_byte("[1 2]", "is not valid JSON; cut short or damaged?");
  EXPECT_EQ(JsonQuoted<TypeParam>(std::string(61, 'x')), "'" + std::string(60, 'x') + "…'");
}

TYPED_TEST(JsonView, NumbersAreFinite) {
  const std::string path = "f";
  const TypeParam json = {{"a", std::numeric_limits<double>::infinity()}};
  EXPECT_EQ(MessageOf<FormatError>([&] { BasicJsonView<TypeParam>(path, json)["a"].Number(); }), "f: a: must be finite");
}

}  // namespace
}  // namespace mvstudio
