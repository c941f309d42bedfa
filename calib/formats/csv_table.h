#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

namespace mvstudio::calib {

/// A comma-separated text file (core/csv.h) with a header line. Lines that begin with '#' are comments. Every error is a
/// FormatError with the line.
class CsvTable {
 public:
  struct Comment {
    int line = 0;
    std::string text;  ///< without '#' and outer blanks
  };

  /// Reads the file. Throws IoError, or FormatError without a header or when a row's number of cells differs from the
  /// header's.
  explicit CsvTable(const std::string& path);

  const std::string& path() const { return path_; }
  const std::vector<std::string>& columns() const { return columns_; }
  const std::vector<Comment>& comments() const { return comments_; }
  size_t num_rows() const { return rows_.size(); }

  /// Position of the first of these names among the columns, -1 when there is none.
  int Find(std::initializer_list<const char*> names) const;
  /// Same; throws FormatError that lists the columns when there is none.
  int Require(std::initializer_list<const char*> names) const;

  const std::string& Text(size_t row, int column) const { return rows_[row].cells[static_cast<size_t>(column)]; }
  /// Finite; throws FormatError otherwise.
  double Number(size_t row, int column) const;
  /// A whole number within +-2^53; throws FormatError otherwise.
  int64_t Integer(size_t row, int column) const;
  /// A frame number (core/csv.h), 0 to 2^53: of images that are named by their time stamps, too.
  int64_t Frame(size_t row, int column) const;
  /// "line 12, x_px".
  std::string Where(size_t row, int column) const;
  std::string Where(size_t row) const { return "line " + std::to_string(rows_[row].line); }

 private:
  struct Row {
    int line = 0;
    std::vector<std::string> cells;
  };

  std::string path_;
  std::vector<std::string> columns_;
  std::vector<Comment> comments_;
  std::vector<Row> rows_;
};

}  // namespace mvstudio::calib
