#pragma once

#include <string>
#include <vector>

namespace mvstudio::report {

/// A CSV file with a header line, kept as text.
struct TableFile {
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;  ///< each as long as `columns`

  int Column(const std::string& name) const;  ///< -1 when absent
  /// NaN when the cell is empty or not a number, or `column` is -1.
  double Number(size_t row, int column) const;
  std::vector<double> Numbers(int column) const;
};

/// Fields may be in double quotes. Throws FormatError with the line without a header, or when a row's number of fields
/// differs from the header's. A last line without its newline is an interrupted write: it is kept only when it is
/// complete.
TableFile ParseTable(const std::string& text, const std::string& path_for_messages);

}  // namespace mvstudio::report
