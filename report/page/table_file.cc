#include "report/page/table_file.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "core/csv.h"
#include "core/error.h"

namespace mvstudio::report {

int TableFile::Column(const std::string& name) const {
  const auto found = std::find(columns.begin(), columns.end(), name);
  return found == columns.end() ? -1 : static_cast<int>(found - columns.begin());
}

double TableFile::Number(size_t row, int column) const {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (column < 0 || row >= rows.size() || static_cast<size_t>(column) >= rows[row].size()) return kNone;
  const std::string& text = rows[row][column];
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  return end == text.c_str() || *end != '\0' ? kNone : number;
}

std::vector<double> TableFile::Numbers(int column) const {
  std::vector<double> numbers(rows.size());
  for (size_t i = 0; i < rows.size(); ++i) numbers[i] = Number(i, column);
  return numbers;
}

TableFile ParseTable(const std::string& text, const std::string& path_for_messages) {
  TableFile table;
  CsvReader csv(path_for_messages, text);
  while (csv.NextLine()) {
    try {
      const std::vector<std::string_view>& cells = csv.Cells();
      if (table.columns.empty()) {
        table.columns.assign(cells.begin(), cells.end());
        continue;
      }
      csv.RequireCells(table.columns.size());
      table.rows.emplace_back(cells.begin(), cells.end());
    } catch (const FormatError&) {
      if (!csv.is_cut()) throw;
    }
  }
  if (table.columns.empty()) throw FormatError(path_for_messages, "", "the file is empty");
  return table;
}

}  // namespace mvstudio::report
