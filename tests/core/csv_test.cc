#include "core/csv.h"

#include "core/disk/files.h"
#include "core/disk/pieces.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

using ::testing::StartsWith;

std::vector<std::vector<std::string>> ReadAll(const std::string& text) {
  std::vector<std::vector<std::string>> rows;
  CsvReader csv("t.csv", text);
  while (csv.NextLine()) {
    const auto& cells = csv.Cells();
    rows.emplace_back(cells.begin(), cells.end());
  }
  return rows;
}

/// The same text in pieces of `size` bytes.
std::vector<std::vector<std::string>> ReadPieces(std::string text, size_t size) {
  std::vector<std::vector<std::string>> rows;
  CsvReader csv("t.csv", [&](std::string* longer) {
    longer->append(text, 0, size);
    const bool came = !text.empty();
    text.erase(0, size);
    return came;
  });
  while (csv.NextLine()) {
    const auto& cells = csv.Cells();
    rows.emplace_back(cells.begin(), cells.end());
    rows.back().push_back(std::to_string(csv.line_number()) + (csv.is_cut() ? " cut" : ""));
  }
  return rows;
}

std::string Complaint(const std::string& text) {
  return MessageOf<FormatError>([&] { ReadAll(text); });
}

TEST(Csv, PiecesOfAFileAreItsLines) {
  for (const char* text : {"a,b\n1,2\n",
                           "\xef\xbb\xbf"
                           "a,b\r\n\r\n1,\"2, 3\"\r\n4,5",
                           "", "\n\n", "alone"}) {
    const auto whole = ReadPieces(text, 1000);
    for (const size_t size : {3, 4, 7}) EXPECT_EQ(ReadPieces(text, size), whole) << text << ", " << size << " bytes at a time";
  }
  EXPECT_EQ(ReadPieces("a,b\n1,2", 3), (std::vector<std::vector<std::string>>{{"a", "b", "1"}, {"1", "2", "2 cut"}}));
}

TEST(FilePieces, LargeFilesAndOnesThatAreNone) {
  const testing::TempDir folder;
  std::string text, back;
  while (text.size() < (5u << 20)) text += std::to_string(text.size()) + "\n";
  WriteFileAtomic(folder / "a.csv", text);
  FilePieces pieces(folder / "a.csv");
  int count = 0;
  while (pieces.Append(&back)) ++count;
  EXPECT_EQ(back, text);
  EXPECT_GT(count, 1);
  EXPECT_THROW(FilePieces(folder.path()), IoError);
  EXPECT_THROW(FilePieces(folder / "none.csv"), IoError);
}

TEST(CsvReader, MarkCrlfBlanksAndEmptyLines) {
  const auto rows = ReadAll("\xef\xbb\xbf a ,\tb\r\n\r\n  \t\r\n1,,\r\n,\n");
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_THAT(rows[0], ElementsAre("a", "b"));
  EXPECT_THAT(rows[1], ElementsAre("1", "", ""));
  EXPECT_THAT(rows[2], ElementsAre("", ""));
  EXPECT_TRUE(ReadAll("").empty());
  EXPECT_TRUE(ReadAll("\xef\xbb\xbf\n\n").empty());
}

TEST(CsvReader, Quotes) {
  const auto rows = ReadAll("\"a, b\" , \" c \",\"\"\n\"say \"\"x\"\"\",\"\"\"\",d\"e\"\n");
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_THAT(rows[0], ElementsAre("a, b", " c ", ""));
  EXPECT_THAT(rows[1], ElementsAre("say \"x\"", "\"", "d\"e\""));
}

TEST(CsvReader, CellsStayValidUntilTheNextLine) {
  CsvReader csv("t.csv", "\"a\"\"1\",\"b\"\"2\",\"c\"\"3\",\"d\"\"4\",\"e\"\"5\"\n");
  ASSERT_TRUE(csv.NextLine());
  EXPECT_THAT(csv.Cells(), ElementsAre("a\"1", "b\"2", "c\"3", "d\"4", "e\"5"));
}

TEST(CsvReader, LineNumbersAndTheLastLine) {
  const std::string text = "a\n\n b\n\nc";
  CsvReader csv("t.csv", text);
  std::vector<int> numbers;
  std::vector<bool> cut;
  for (; csv.NextLine(); cut.push_back(csv.is_cut())) numbers.push_back(csv.line_number());
  EXPECT_THAT(numbers, ElementsAre(1, 3, 5));
  EXPECT_THAT(cut, ElementsAre(false, false, true));
  EXPECT_EQ(csv.line(), "c");
  EXPECT_EQ(csv.Where(), "line 5");
}

TEST(CsvReader, ErrorsNameTheLineAndTheLikelyCause) {
  EXPECT_THAT(Complaint("a,b\n1,\"2\n3\"\n"), StartsWith("t.csv: line 2: a quote does not end in this line"));
  EXPECT_THAT(Complaint("a,b\n\"1\"x,2\n"), StartsWith("t.csv: line 2: a comma was expected behind the cell in quotes"));
  EXPECT_THAT(Complaint("a;b\n1;2\n"), StartsWith("t.csv: line 1: no comma, but ';'"));
  EXPECT_THAT(Complaint("a\tb\n"), StartsWith("t.csv: line 1: no comma, but tabs"));
  EXPECT_EQ(Complaint("a\n1;2\n"), "no exception");
  const auto width = [](const std::string& text) {
    return MessageOf<FormatError>([&] {
      CsvReader csv("t.csv", text);
      csv.NextLine();
      const size_t count = csv.Cells().size();
      for (; csv.NextLine(); csv.RequireCells(count)) csv.Cells();
    });
  };
  EXPECT_EQ(width("a,b\n1,2\n"), "no exception");
  EXPECT_THAT(width("a,b\n1,2\n1\n"), StartsWith("t.csv: line 3: 1 columns, the header has 2; is the line damaged"));
  EXPECT_THAT(width("a,b\n1,5,2\n"), StartsWith("t.csv: line 2: 3 columns, the header has 2; decimal commas"));
}

TEST(CsvReader, WhatIsWrittenIsRead) {
  Rng rng(5);
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<std::string> cells(1 + static_cast<size_t>(rng.Index(4)));
    std::string line;
    for (std::string& cell : cells) {
      for (int64_t length = rng.Index(6); length > 0; --length) cell += "a1,\" \t#;\r"[rng.Index(9)];
      line += (line.empty() ? "x," : ",") + CsvCell(cell);
    }
    const auto rows = ReadAll(line + "\n");
    ASSERT_EQ(rows.size(), 1u) << line;
    EXPECT_EQ(std::vector<std::string>(rows[0].begin() + 1, rows[0].end()), cells) << line;
  }
  EXPECT_EQ(CsvCell("left 1"), "left 1");
  EXPECT_EQ(CsvCell("#1"), "\"#1\"");
}

TEST(CsvReader, AnyBytesGiveRowsOrOneError) {
  Rng rng(6);
  const std::string good = "camera,frame,x\n\"a, b\",1,2.5\nc,\"\"\"\",3\n";
  for (int trial = 0; trial < 2000; ++trial) {
    std::string text = good;
    for (int k = 0; k < 3; ++k)
      text[static_cast<size_t>(rng.Index(static_cast<int64_t>(text.size())))] = static_cast<char>(rng.Index(256));
    const std::string complaint = Complaint(text);
    EXPECT_TRUE(complaint == "no exception" || complaint.rfind("t.csv: line ", 0) == 0) << complaint;
  }
}

TEST(ReadFrameNumber, WholeExactAndSaysWhyNot) {
  std::string why;
  constexpr int64_t kMost = int64_t{1} << 53;
  EXPECT_EQ(ReadFrameNumber("0", 9, &why), 0);
  EXPECT_EQ(ReadFrameNumber("12.000", kMost, &why), 12);
  EXPECT_EQ(ReadFrameNumber("9007199254740991", kMost, &why), kMost - 1) << "not by a floating-point number";
  EXPECT_EQ(why, "");
  for (const char* large : {"10", "9007199254740993", "99999999999999999999999"}) {
    EXPECT_EQ(ReadFrameNumber(large, large[0] == '1' ? 9 : kMost, &why), -1);
    EXPECT_THAT(why, HasSubstr("too large")) << large;
  }
  EXPECT_EQ(ReadFrameNumber("-1", 9, &why), -1);
  EXPECT_THAT(why, HasSubstr("counted from 0"));
  for (const char* other : {"", "1.5", "x", "1e3", "1,0", "nan", "."}) {
    EXPECT_EQ(ReadFrameNumber(other, 9, &why), -1);
    EXPECT_THAT(why, HasSubstr("not a whole number")) << other;
  }
}

TEST(DecimalCommaHint, OnlyForNumbersWithOneComma) {
  EXPECT_THAT(DecimalCommaHint("1,5"), HasSubstr("decimal point"));
  EXPECT_THAT(DecimalCommaHint("-1,5e3"), HasSubstr("decimal point"));
  for (const char* text : {"", "1.5", "1,500,000", "a,b", "x"}) EXPECT_EQ(DecimalCommaHint(text), "") << text;
}

}  // namespace
}  // namespace mvstudio
