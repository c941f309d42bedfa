#include "report/page/value.h"

#include <gtest/gtest.h>

#include "core/disk/files.h"
#include "core/error.h"
#include "report/study/study.h"
#include "report/study/study_tally.h"
#include "tests/support/cpu_time.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::report {
namespace {

using mvstudio::testing::TempDir;

std::string Key(int i) { return "k" + std::to_string(i); }

TEST(Value, ManyFieldsKeepTheirOrderAndAreFound) {
  Value object;
  for (int i = 0; i < 100; ++i) object.Set(Key(99 - i), i);
  object.Set("k99", "new");
  ASSERT_EQ(object.fields().size(), 100u);
  EXPECT_EQ(object.fields()[0].first, "k99");
  EXPECT_EQ(object["k99"].Text(), "new");
  EXPECT_EQ(object["k0"].integer(), 99);
  EXPECT_TRUE(object["none"].IsNull());
  const Value back = Value::Parse(object.Dump(), "f");
  EXPECT_EQ(back.Dump(), object.Dump());
  EXPECT_EQ(back["k50"].integer(), 49);
}

TEST(Value, CopiesOfObjectsGoTheirOwnWays) {
  Value a;
  for (int i = 0; i < 40; ++i) a.Set(Key(i), i);
  Value b = a;
  b.Set("only b", 1), a.Set("only a", 2), b.Set("k3", "b");
  EXPECT_TRUE(a["only b"].IsNull());
  EXPECT_TRUE(b["only a"].IsNull());
  EXPECT_EQ(a["only a"].integer(), 2);
  EXPECT_EQ(b["only b"].integer(), 1);
  EXPECT_EQ(a["k3"].integer(), 3);
  EXPECT_EQ(b["k3"].Text(), "b");
}

TEST(Value, TheLastOfTwoEqualKeysCounts) {
  EXPECT_EQ(Value::Parse(R"({"a": 1, "b": 2, "a": [3]})", "f").Dump(), R"({"a":[3],"b":2})");
}

template <class Item>
std::string TenMegabytes(const std::string& head, const Item& item, const std::string& tail) {
  std::string text = head;
  for (int i = 0; text.size() < (10u << 20); ++i) text += (i ? "," : "") + item(i);
  return text + tail;
}

// Quadratic reading of any of these takes many minutes.
TEST(Value, TenMegabytesAreReadAtOnce) {
  const double start = mvstudio::testing::CpuSeconds();
  const auto key = [](int i) { return "\"" + Key(i) + "\":0"; };
  const auto empty = [](int) { return std::string("{}"); };
  const std::string keys = TenMegabytes("{", key, "}");
  const Value value = Value::Parse(keys, "f");
  EXPECT_EQ(value.Dump(), keys);
  EXPECT_GT(Value::Parse(TenMegabytes("[", empty, "]"), "f").items().size(), 3000000u);
  EXPECT_THROW(Value::Parse(TenMegabytes(
                                "", [](int) { return std::string("[[[[{\"a\":["); }, ""),
                            "f"),
               FormatError);
  EXPECT_LT(mvstudio::testing::CpuSeconds() - start, 20);
}

// Answers beside as many keys that nobody asks for.
TEST(StudyAnswers, TenMegabytesAreAnsweredAtOnce) {
  const double start = mvstudio::testing::CpuSeconds();
  const TempDir folder;
  const std::string head =
      std::string(R"({"schema":")") + kStudyAnswersSchema + R"(","study":"s","rater":"r","methods":["a","b"],"answers":[)";
  const auto answer = [](int i) {
    const std::string image = "p" + std::to_string(i);
    return R"({"picture":")" + image + R"(","choice":"left","seal":")" + StudySeal("s", image, "a") + R"("})";
  };
  std::string text = TenMegabytes(head, answer, "]");
  for (int i = 0; i < 300000; ++i) text += ",\"" + Key(i) + "\":0";
  WriteFileAtomic(folder / "answers.json", text + "}");
  EXPECT_GT(ReadStudyAnswers(folder / "answers.json").answers.size(), 100000u);
  EXPECT_LT(mvstudio::testing::CpuSeconds() - start, 20);
}

}  // namespace
}  // namespace mvstudio::report
