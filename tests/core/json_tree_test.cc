#include "core/json_tree.h"

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "tests/support/cpu_time.h"
#include "tests/support/sanitized.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

using Kind = JsonProblem::Kind;
using Ordered = nlohmann::ordered_json;
using Sorted = nlohmann::json;

template <class Json>
Json Parsed(const std::string& text, const JsonLimits& limits = {}) {
  Json json;
  const JsonProblem problem = ParseJsonTree(text, limits, &json);
  EXPECT_EQ(problem.kind, Kind::kNone) << text.substr(0, 100);
  return json;
}

template <class Json>
JsonProblem Refused(const std::string& text, const JsonLimits& limits = {}) {
  Json json = "untouched";
  const JsonProblem problem = ParseJsonTree(text, limits, &json);
  EXPECT_EQ(json, "untouched");
  return problem;
}

constexpr char kDocument[] =
    R"({"z": 1, "a": [1.5, -2, 18446744073709551615, true, null, "\u00e9\n", [], {}, {"k": {"l": [[1]]}}], "m": {"y": 2, "b": 3}})";

TEST(JsonTree, TheTreeOfTheLibrary) {
  EXPECT_EQ(Parsed<Ordered>(kDocument).dump(), Ordered::parse(kDocument).dump());
  EXPECT_EQ(Parsed<Sorted>(kDocument).dump(), Sorted::parse(kDocument).dump());
  for (const char* scalar : {"1", "\"x\"", "null", " [ ] ", "{}"}) {
    EXPECT_EQ(Parsed<Ordered>(scalar), Ordered::parse(scalar));
  }
  EXPECT_TRUE(std::signbit(Parsed<Ordered>("-0").get<double>()));
}

TEST(JsonTree, KeysThatAreThereTwice) {
  const std::string text = R"({"c": [0, {"a": 1, "b": 2, "a": [3], "c": 4, "b": 5}]})";
  for (const JsonProblem& problem : {Refused<Ordered>(text), Refused<Sorted>(text)}) {
    EXPECT_EQ(problem.kind, Kind::kTwice);
    EXPECT_EQ(problem.where, "c[1]");
    EXPECT_EQ(problem.key, "a");
  }
  const JsonLimits last_counts = {64, false};
  EXPECT_EQ(Parsed<Ordered>(text, last_counts).dump(), Ordered::parse(text).dump());
  EXPECT_EQ(Parsed<Ordered>(text, last_counts).dump(), R"({"c":[0,{"a":[3],"b":5,"c":4}]})");
  EXPECT_EQ(Parsed<Sorted>(text, last_counts).dump(), Sorted::parse(text).dump());
}

TEST(JsonTree, Problems) {
  EXPECT_EQ(Refused<Ordered>("[[[1]]]", {2, true}).kind, Kind::kDepth);
  EXPECT_EQ(Parsed<Ordered>("[[1]]", {2, true}).size(), 1u);
  EXPECT_EQ(Refused<Ordered>(std::string(1000000, '[')).kind, Kind::kDepth);
  EXPECT_EQ(Refused<Ordered>("[1e999]").kind, Kind::kNumber);
  for (const std::string bad : {"", "[1", "{\"a\"}", "[1,]", "nul", "{} x", "\"\xff\"", "{\"a\": 1"}) {
    const JsonProblem problem = Refused<Ordered>(bad);
    EXPECT_EQ(problem.kind, Kind::kSyntax) << bad;
    try {
      ADD_FAILURE() << Ordered::parse(bad);
    } catch (const Ordered::parse_error& error) {
      EXPECT_EQ(problem.byte, error.byte) << bad;
    }
  }
}

std::string Repeated(const std::string& head, const std::function<std::string(int)>& item, const std::string& tail) {
  constexpr size_t kBytes = 10u << 20;
  std::string text = head;
  for (int i = 0; text.size() < kBytes; ++i) text += (i ? "," : "") + item(i);
  return text + tail;
}

// Quadratic reading of any of these takes minutes to hours.
TEST(JsonTree, TenMegabytesAreReadAtOnce) {
  const double start = mvstudio::testing::CpuSeconds();
  const std::string keys = Repeated(
      "{", [](int i) { return "\"k" + std::to_string(i) + "\":0"; }, "}");
  const std::string twins = Repeated(
      "{", [](int i) { return "\"k" + std::to_string(i / 2) + "\":0"; }, "}");
  const std::string objects = Repeated(
      "[", [](int) { return "{}"; }, "]");
  const std::string lists = Repeated(
      "[", [](int) { return "[[[]]]"; }, "]");
  EXPECT_GT(Parsed<Ordered>(keys).size(), 700000u);
  EXPECT_GT(Parsed<Sorted>(keys).size(), 700000u);
  EXPECT_GT(Parsed<Ordered>(twins, {64, false}).size(), 350000u);
  EXPECT_EQ(Refused<Ordered>(twins).kind, Kind::kTwice);
  EXPECT_GT(Parsed<Ordered>(objects).size(), 3000000u);
  EXPECT_GT(Parsed<Sorted>(objects).size(), 3000000u);
  EXPECT_GT(Parsed<Ordered>(lists).size(), 1000000u);
  EXPECT_LT(mvstudio::testing::CpuSeconds() - start, mvstudio::testing::kSanitized ? 300 : 20);
}

}  // namespace
}  // namespace mvstudio
