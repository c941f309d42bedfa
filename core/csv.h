#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace mvstudio {

/// Lines and cells of comma-separated text. A cell may be in double quotes, with inner quotes doubled, but may not span
/// lines. Blanks around cells, a byte-order mark and the CR of CRLF are removed. Errors are FormatErrors with the line.
class CsvReader {
 public:
  /// `text` must outlive the reader.
  CsvReader(std::string path, std::string_view text);
  /// Of text that comes in pieces: `append` adds the next to its argument, false when there is none (core/disk/pieces.h). Lines
  /// that were read are not kept.
  CsvReader(std::string path, std::function<bool(std::string*)> append);
  CsvReader(const CsvReader&) = delete;
  CsvReader& operator=(const CsvReader&) = delete;

  /// Advances to the next line that is not blank; false at the end.
  bool NextLine();
  /// The line without blanks around it.
  std::string_view line() const { return line_; }
  int line_number() const { return line_number_; }
  /// The text ends without a line break: possibly an interrupted write.
  bool is_cut() const { return is_cut_; }

  /// Cells of the line, valid until the next call. The first line requested is the header; semicolons or tabs instead of
  /// commas are detected there.
  const std::vector<std::string_view>& Cells();
  /// Requires as many cells as the header has; the error suggests a cause.
  void RequireCells(size_t count) const;

  const std::string& path() const { return path_; }
  std::string Where() const { return "line " + std::to_string(line_number_); }
  [[noreturn]] void Fail(const std::string& what) const;

 private:
  void DropByteOrderMark();
  bool AppendPiece();
  void CheckSeparator() const;
  std::string_view TakeQuoted(std::string_view* rest);

  std::string path_;
  std::function<bool(std::string*)> append_;  ///< empty: nothing comes after `rest_`
  std::string piece_;                         ///< what `rest_` is of, if it comes in pieces
  std::string_view rest_, line_;
  int line_number_ = 0;
  bool is_cut_ = false, has_header_ = false;
  std::vector<std::string_view> cells_;
  std::deque<std::string> unquoted_;  ///< cells of this line with doubled quotes
};

/// A frame number of a table: a whole number from 0 to `most`; also "12.0", as tables of floating-point numbers have it. -1
/// for anything else, and `why` says what is wrong with it: "is `-1`, …".
int64_t ReadFrameNumber(std::string_view text, int64_t most, std::string* why);

/// What is wrong with a cell that holds no number that can be read: "not a number", with a hint, or that it is too large.
std::string WhyNoNumber(std::string_view text);

/// A text as a cell, in quotes where needed. Line breaks cannot be written.
std::string CsvCell(std::string_view text);

/// Hint for messages about a text that is not a number: "; is its comma a decimal point?" for one like 1,5, else empty.
std::string DecimalCommaHint(std::string_view text);

}  // namespace mvstudio
