#include "report/page/html.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "core/error.h"
#include "report/page/format.h"
#include "report/page/image.h"
#include "report/page/table_file.h"
#include "report/page/value.h"
#include "tests/report/markup.h"

namespace mvstudio::report {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(EscapeHtml, MarkupAndQuotes) {
  EXPECT_EQ(EscapeHtml("<script>alert('x')</script>"), "&lt;script&gt;alert(&#39;x&#39;)&lt;/script&gt;");
  EXPECT_EQ(EscapeHtml("\"a\" & b"), "&quot;a&quot; &amp; b");
  EXPECT_EQ(EscapeHtml("Fr\u00e9chet \u4eba \U0001F3A5"), "Fr\u00e9chet \u4eba \U0001F3A5");
}

TEST(EscapeHtml, BrokenUtf8AndControlCharacters) {
  EXPECT_EQ(EscapeHtml("a\xff"
                       "b"),
            "a\ufffd"
            "b");
  EXPECT_EQ(EscapeHtml("\xc3"), "\ufffd");                                // cut off
  EXPECT_EQ(EscapeHtml("\xc0\xbc"), "\ufffd\ufffd");                      // overlong '<'
  EXPECT_EQ(EscapeHtml("\xed\xa0\x80").find('\xed'), std::string::npos);  // surrogate
  EXPECT_EQ(EscapeHtml(std::string("a\0b", 3)),
            "a\ufffd"
            "b");
  EXPECT_EQ(EscapeHtml("a\x1b[31mb"), "a\ufffd[31mb");
}

TEST(MapTexts, ChangesWhatPeopleReadAndNothingElse) {
  const auto loud = [](const std::string& text) {
    std::string changed;
    for (const char c : text) changed += c == 'a' ? std::string("<A>") : std::string(1, c);
    return changed;
  };
  EXPECT_EQ(MapTexts("<a class=\"a\" alt=\"a &gt; b\" src=\"data:a\">a &amp; b</a><script>a</script><style>a</style>a", loud),
            "<a class=\"a\" alt=\"&lt;A&gt; &gt; b\" src=\"data:a\">&lt;A&gt; &amp; b</a><script>a</script><style>a</style>"
            "&lt;A&gt;");
  const Section section{"id", "A \"title\" & more", ParagraphHtml("it's <here>")};
  const std::string page = PageHtml("title", "", {section}, "footer", "let a = 1 < 2;");
  EXPECT_EQ(MapTexts(page, [](const std::string& text) { return text; }), page);
}

TEST(Table, IsReachedByTheKeyboardWhereItIsWideAndHasNoEmptyHeader) {
  Table narrow(""), wide("Cameras");
  for (const char* title : {"", "a"}) narrow.AddColumn(title), wide.AddColumn(title);
  wide.AddColumn("d");
  EXPECT_THAT(narrow.Html(),
              HasSubstr("<div class=\"scroll\"><table><thead><tr><td></td><th scope=\"col\" class=\"num\">a</th>"));
  EXPECT_THAT(wide.Html(), HasSubstr("<div class=\"scroll\" tabindex=\"0\" role=\"group\" aria-label=\"Table: Cameras\">"));
}

TEST(Verdict, WorseAndWords) {
  EXPECT_EQ(Worse(Verdict::kNotRun, Verdict::kPass), Verdict::kPass);
  EXPECT_EQ(Worse(Verdict::kWarn, Verdict::kPass), Verdict::kWarn);
  EXPECT_EQ(Worse(Verdict::kWarn, Verdict::kFail), Verdict::kFail);
  EXPECT_THAT(BadgeHtml(Verdict::kFail), HasSubstr("fail"));
}

TEST(Table, EscapesAndMarks) {
  Table table("cap <b>");
  table.AddColumn("name", "", false);
  table.AddColumn("rms", "px");
  table.AddRow({"<img src=x onerror=alert(1)>", "0.25"}, true);
  EXPECT_THROW(table.AddRow({"short"}), ContractViolation);
  const std::string html = table.Html();
  EXPECT_THAT(html, Not(HasSubstr("<img")));
  EXPECT_THAT(html, HasSubstr("&lt;img"));
  EXPECT_THAT(html, HasSubstr("<tr class=\"look\">"));
  EXPECT_EQ(CheckMarkup(html), "");
}

TEST(Page, ForbidsEverythingFromOutside) {
  const std::string html = PageHtml("t</title><script>", "", {{"id", "Title & co", "<p>x</p>"}}, "foot");
  EXPECT_THAT(html, HasSubstr("default-src 'none'"));
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("http://")));
  EXPECT_THAT(html, Not(HasSubstr("https://")));
}

TEST(FormatNumber, SignificantDigits) {
  EXPECT_EQ(FormatNumber(0.23412345), "0.2341");
  EXPECT_EQ(FormatNumber(1285), "1285");
  EXPECT_EQ(FormatNumber(6.3), "6.3");
  EXPECT_EQ(FormatNumber(83.24567, 5), "83.246");
  EXPECT_EQ(FormatNumber(3.14e-6), "3.14e-06");
  EXPECT_EQ(FormatNumber(0), "0");
  EXPECT_EQ(FormatNumber(-0.0), "0");
  EXPECT_EQ(FormatNumber(kNan), "\u2013");
  EXPECT_EQ(FormatNumber(std::numeric_limits<double>::infinity()), "\u2013");
  EXPECT_EQ(FormatNumber(999.96), "1000");
}

TEST(FormatNumber, UnitsCountsAndDurations) {
  EXPECT_EQ(FormatWithUnit(4.2, "mm"), "4.2\u00a0mm");
  EXPECT_EQ(FormatWithUnit(kNan, "mm"), "\u2013");
  EXPECT_EQ(FormatCount(1234567), "1\u202f234\u202f567");
  EXPECT_EQ(FormatCount(-999), "-999");
  EXPECT_EQ(FormatCount(-1999), "-1\u202f999");
  EXPECT_EQ(FormatDuration(0.25), "250\u00a0ms");
  EXPECT_EQ(FormatDuration(245),
            "4\u00a0min\u00a0"
            "5\u00a0s");
  EXPECT_EQ(FormatDuration(kNan), "\u2013");
}

TEST(LabelOfKey, UnitFromTheSuffix) {
  EXPECT_EQ(LabelOfKey("holdout_rms_px").label, "held-out rms");
  EXPECT_EQ(LabelOfKey("holdout_rms_px").unit, "px");
  EXPECT_EQ(LabelOfKey("psnr_db").unit, "dB");
  EXPECT_EQ(LabelOfKey("points_per_s").label, "points per second");
  EXPECT_EQ(LabelOfKey("points_per_s").unit, "");
  EXPECT_EQ(LabelOfKey("num_params").label, "params");
  EXPECT_EQ(LabelOfKey("_px").label, " px");
}

TEST(Value, ReadsLeniently) {
  const Value value = Value::Parse(R"({"a":{"b":[1,2.5,null,"x"]},"big":9007199254740993,"t":true})", "f");
  EXPECT_EQ(value.Path("a.b").At(1).Number(), 2.5);
  EXPECT_TRUE(std::isnan(value.Path("a.b").At(2).Number()));
  EXPECT_TRUE(std::isnan(value.Path("a.nothing.here").Number()));
  EXPECT_EQ(value.Path("a.b").At(3).Text(), "x");
  EXPECT_TRUE(value["t"].Flag());
  EXPECT_EQ(value.FirstNumber({"a.b", "missing", "big"}), 9007199254740993.0);
  EXPECT_EQ(value.Dump(), R"({"a":{"b":[1,2.5,null,"x"]},"big":9007199254740993,"t":true})");
}

TEST(Value, NonFiniteBecomesNullAndBrokenUtf8Survives) {
  EXPECT_EQ(Value::Object().Set("x", kNan).Set("y", 1.5).Dump(), R"({"x":null,"y":1.5})");
  EXPECT_EQ(Value("a\xff").Dump(), "\"a\ufffd\"");
}

TEST(Value, RefusesBrokenAndDeepText) {
  EXPECT_THROW(Value::Parse("{\"a\": [1, 2", "f"), FormatError);
  EXPECT_THROW(Value::Parse("", "f"), FormatError);
  EXPECT_THROW(Value::Parse("{\"a\": NaN}", "f"), FormatError);
  EXPECT_THROW(Value::Parse(std::string(100000, '['), "f"), FormatError);
  EXPECT_NO_THROW(Value::Parse("\"" + std::string(1000, '[') + "\"", "f"));
  try {
    Value::Parse("{\"a\": ", "dir/file.json");
    FAIL();
  } catch (const FormatError& error) {
    EXPECT_THAT(error.what(), HasSubstr("dir/file.json"));
  }
}

TEST(ParseTable, QuotesEmptyCellsAndAnInterruptedLastLine) {
  const TableFile table = ParseTable("a,b,c\r\n1,,\"x, \"\"y\"\"\"\n2,3", "t.csv");
  ASSERT_EQ(table.rows.size(), 1u);
  EXPECT_EQ(table.Number(0, 0), 1);
  EXPECT_TRUE(std::isnan(table.Number(0, 1)));
  EXPECT_EQ(table.rows[0][2], "x, \"y\"");
  EXPECT_EQ(table.Column("c"), 2);
  EXPECT_EQ(table.Column("d"), -1);
  EXPECT_TRUE(std::isnan(table.Number(0, -1)));
  EXPECT_TRUE(std::isnan(table.Number(7, 0)));
}

TEST(ParseTable, AQuoteThatIsCutIsAnInterruptedLastLine) {
  EXPECT_EQ(ParseTable("a,b\n1,2\n3,\"x", "t.csv").rows.size(), 1u);
  EXPECT_THROW(ParseTable("a,b\n1,2\n3,\"x\n", "t.csv"), FormatError);
}

TEST(ParseTable, RefusesRaggedAndEmpty) {
  EXPECT_THROW(ParseTable("a,b\n1\n2,3\n", "t.csv"), FormatError);
  EXPECT_THROW(ParseTable("", "t.csv"), FormatError);
}

TEST(Base64, VectorsOfRfc4648) {
  EXPECT_EQ(Base64(""), "");
  EXPECT_EQ(Base64("f"), "Zg==");
  EXPECT_EQ(Base64("fo"), "Zm8=");
  EXPECT_EQ(Base64("foo"), "Zm9v");
  EXPECT_EQ(Base64("foob"), "Zm9vYg==");
  EXPECT_EQ(Base64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(Base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(Base64("\xff\xfe\xfd"), "//79");
}

TEST(Image, TypeByContentAlone) {
  EXPECT_EQ(ImageType(std::string("\x89PNG\r\n\x1a\n") + "rest"), "image/png");
  EXPECT_EQ(ImageType("\xff\xd8\xff\xe0"), "image/jpeg");
  EXPECT_EQ(ImageType("<svg onload=alert(1)>"), "");
  EXPECT_EQ(ImageType(""), "");
  int width = 0, height = 0;
  EXPECT_FALSE(PngSize("\x89PNG\r\n\x1a\n", &width, &height));
}

}  // namespace
}  // namespace mvstudio::report
