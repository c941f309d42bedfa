#include "calib/formats/document.h"

#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::calib::internal {
namespace {

const std::string kPath = "f";

TEST(Literal, JsonAndPython) {
  for (const char* text : {R"({"a": [1, -2.5e-1, "x\u00e9\n"], "b": {"c": true}, "d": null})",
                           R"(# comment
                             { 'a': ( 1, -.25, r'x' "\xe9\n", ), 'b': {'c': True,}, 'd': None, } # end)"}) {
    const Value value = ParseLiteral("f", text);
    const ValueView view(kPath, value);
    EXPECT_EQ(view["a"].ListSize(), 3u);
    EXPECT_EQ(view["a"][1].Number(), -0.25);
    EXPECT_EQ(view["a"][2].Text(), "x\xc3\xa9\n");
    EXPECT_EQ(view["b"]["c"].Number(), 1);
    EXPECT_EQ(view["d"].value().kind, Value::Kind::kNull);
    EXPECT_EQ(view["b"]["c"].where(), "b.c");
  }
}

TEST(Literal, ErrorsNameTheLine) {
  const std::pair<const char*, const char*> cases[] = {{"{'a': 1", "f: line 1: ',' or '}'"},
                                                       {"{'a': \n nan}", "f: line 2: 'nan'"},
                                                       {"{'a': 1, 'a': 2}", "occurs twice"},
                                                       {"[1, 2)", "',' or ']'"},
                                                       {"{1: 2}", "quoted key"},
                                                       {"[1] 2", "after the value"},
                                                       {"", "truncated"},
                                                       {"{'a': 'x", "does not end"},
                                                       {"[\"\\uzz\"]", "hexadecimal"},
                                                       {"[1e999]", "not a finite number"},
                                                       {"{'a' 1}", "':' was expected"}};
  for (const auto& [text, message] : cases) {
    EXPECT_NE(MessageOf<FormatError>([&, t = text] { ParseLiteral("f", t); }).find(message), std::string::npos)
        << text << " -> " << MessageOf<FormatError>([&, t = text] { ParseLiteral("f", t); });
  }
  EXPECT_NE(MessageOf<FormatError>([] { ParseLiteral("f", std::string(100000, '[')); }).find("nested"), std::string::npos);
}

TEST(Yaml, BlocksSequencesAndFlow) {
  const Value value = ParseYaml("f", R"(%YAML 1.2
---
cam0:   # first
  list:
  - [1, 2.5]
  - [3, 4]
  nested:
    - a: 1
      b: "x # y"
    - plain text
  empty:
'quoted key': {x: 1, y: [true, ~]}
)");
  const ValueView view(kPath, value);
  EXPECT_EQ(view["cam0"]["list"].Matrix(2, 2)(1, 0), 3);
  EXPECT_EQ(view["cam0"]["nested"][0]["b"].Text(), "x # y");
  EXPECT_EQ(view["cam0"]["nested"][1].Text(), "plain text");
  EXPECT_EQ(view["cam0"]["empty"].value().kind, Value::Kind::kNull);
  EXPECT_EQ(view["quoted key"]["x"].Number(), 1);
}

TEST(Yaml, ErrorsNameTheLine) {
  const std::pair<const char*, const char*> cases[] = {
      {"a: 1\na: 2", "line 2: the key 'a' occurs twice"},
      {"{a: 1, a: 2}", "line 1: the key 'a' occurs twice"},
      {"a: 1\n---\na: 2", "line 3: the key 'a' occurs twice"},
      {"a: 1\nb", "line 2: 'key: value'"},
      {"a:\n  b: 1\n  c", "line 3: 'key: value'"},
      {"a: &x 1", "line 1: this part of YAML"},
      {"a: 1\nb: *x", "line 2: not valid YAML"},
      {"a: [1, 2", "line 1: 'key: value' was expected, or a bracket is not closed"},
      {"a: [1,", "line 1: not valid YAML"},
      {"a: 1\n  b: 2", "line 2: not valid YAML"},
      {"a: \"x\n  y\n", "line 1: a quoted text does not end"},
      {"a: !!str 'x\n  y\n", "line 1: a quoted text does not end"},
      {"? [1]\n: 2", "line 1: a text was expected as the key"},
      {": 2", "line 1: a key was expected"},
      {"- 1\nb: 2", "line 2: "},
      {"a: 1\nb: \x04\nc: 2", "line 2: a control character"},
      {"# only a comment", "empty"},
      {"", "empty"}};
  for (const auto& [text, message] : cases) {
    EXPECT_NE(MessageOf<FormatError>([&, t = text] { ParseYaml("f", t); }).find(message), std::string::npos)
        << text << " -> " << MessageOf<FormatError>([&, t = text] { ParseYaml("f", t); });
  }
  std::string deep;
  for (int i = 0; i < 200; ++i) deep += std::string(static_cast<size_t>(i), ' ') + "a:\n";
  EXPECT_NE(MessageOf<FormatError>([&] { ParseYaml("f", deep); }).find("nested"), std::string::npos);
  EXPECT_NE(MessageOf<FormatError>([] {
              std::string text;
              for (int i = 0; i < 20000; ++i) text += "- ";
              ParseYaml("f", text + "1");
            }).find("nested"),
            std::string::npos);
  EXPECT_NE(
      MessageOf<FormatError>([] { ParseYaml("f", "a:\n" + std::string(100000, '[')); }).find("line 2: brackets are nested"),
      std::string::npos);
}

TEST(Yaml, ScalarsKeepWhatIsWritten) {
  const Value value = ParseYaml("f", "[01, +2.5, '3', .inf, .nan, 1e999, true, ~, 0x10, !!str 5]");
  const std::pair<Value::Kind, const char*> expected[] = {{Value::Kind::kNumber, "01"},   {Value::Kind::kNumber, "+2.5"},
                                                          {Value::Kind::kText, "3"},      {Value::Kind::kText, ".inf"},
                                                          {Value::Kind::kText, ".nan"},   {Value::Kind::kText, "1e999"},
                                                          {Value::Kind::kNumber, "true"}, {Value::Kind::kNull, ""},
                                                          {Value::Kind::kText, "0x10"},   {Value::Kind::kNumber, "5"}};
  ASSERT_EQ(value.items.size(), std::size(expected));
  for (size_t i = 0; i < value.items.size(); ++i) {
    EXPECT_EQ(value.items[i].kind, expected[i].first) << i;
    EXPECT_EQ(value.items[i].text, expected[i].second) << i;
  }
  EXPECT_EQ(value.items[1].number, 2.5);
  const Value marked = ParseYaml("f", std::string("\xef\xbb\xbf") + "a: 1\r\nb: 2\r\n");
  EXPECT_EQ(marked.entries[0].first, "a");
  EXPECT_EQ(marked.entries[1].second.line, 2);
}

TEST(View, SaysWhatIsWrongWhere) {
  const Value value = ParseLiteral("f", "{'a': [[1, 2], [3]], 'b': 'x'}");
  const ValueView view(kPath, value);
  EXPECT_EQ(MessageOf<FormatError>([&] { view["a"].Matrix(2, 2); }), "f: a[1]: 1 numbers, 2 expected");
  EXPECT_EQ(MessageOf<FormatError>([&] { view["c"]; }), "f: the key 'c' is missing");
  EXPECT_EQ(MessageOf<FormatError>([&] { view["b"].Number(); }), "f: b: a number was expected");
  EXPECT_EQ(MessageOf<FormatError>([&] { view["b"]["c"]; }), "f: b: a table of keys and values was expected");
  EXPECT_EQ(MessageOf<FormatError>([&] { view["a"][5]; }), "f: a: entry 5 is missing");
}

}  // namespace
}  // namespace mvstudio::calib::internal
