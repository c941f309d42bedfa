#include "report/page/table_file.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "core/error.h"

namespace mvstudio::report {
namespace {

std::vector<std::string> SplitLine(const std::string& line) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  for (size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (c == '"' && quoted && i + 1 < line.size() && line[i + 1] == '"') {
      fields.back() += line[++i];
    } else if (c == '"') {
      quoted = !quoted;
    } else if (c == ',' && !quoted) {
      fields.emplace_back();
    } else if (c != '\r') {
      fields.back() += c;
    }
  }
  return fields;
}

}  // namespace

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
  size_t line_number = 0;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line = text.substr(begin, end - begin);
    const bool unfinished = end == text.size();
    begin = end + 1;
    ++line_number;
    if (line.empty() || line == "\r") continue;
    std::vector<std::string> fields = SplitLine(line);
    if (table.columns.empty()) {
      table.columns = std::move(fields);
    } else if (fields.size() == table.columns.size()) {
      table.rows.push_back(std::move(fields));
    } else if (!unfinished) {
      throw FormatError(path_for_messages, "line " + std::to_string(line_number),
                        std::to_string(fields.size()) + " fields where the header has " + std::to_string(table.columns.size()));
    }
  }
  if (table.columns.empty()) throw FormatError(path_for_messages, "", "the file is empty");
  return table;
}

}  // namespace mvstudio::report
