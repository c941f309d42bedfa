#include "calib/formats/csv_table.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "calib/formats/formats_internal.h"
#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio::calib {
namespace {

std::string Trimmed(const std::string& text) {
  const size_t first = text.find_first_not_of(" \t\r\n");
  return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(" \t\r\n") + 1 - first);
}

/// Cells of a line; a cell in double quotes may hold commas and doubled quotes.
std::vector<std::string> SplitCells(const std::string& line) {
  std::vector<std::string> cells(1);
  bool quoted = false;
  for (size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"' && quoted && i + 1 < line.size() && line[i + 1] == '"') {
      cells.back() += line[i++];
    } else if (line[i] == '"') {
      quoted = !quoted;
    } else if (line[i] == ',' && !quoted) {
      cells.emplace_back();
    } else {
      cells.back() += line[i];
    }
  }
  for (std::string& cell : cells) cell = Trimmed(cell);
  return cells;
}

}  // namespace

CsvTable::CsvTable(const std::string& path) : path_(path) {
  std::string text = ReadFile(path);
  if (text.compare(0, 3, "\xef\xbb\xbf") == 0) text.erase(0, 3);
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    line = Trimmed(line);
    if (line.empty()) continue;
    if (line[0] == '#') {
      comments_.push_back({number, Trimmed(line.substr(1))});
      continue;
    }
    std::vector<std::string> cells = SplitCells(line);
    if (columns_.empty()) {
      columns_ = std::move(cells);
    } else if (cells.size() != columns_.size()) {
      throw FormatError(path, "line " + std::to_string(number),
                        std::to_string(cells.size()) + " cells, the header has " + std::to_string(columns_.size()));
    } else {
      rows_.push_back({number, std::move(cells)});
    }
  }
  if (columns_.empty()) throw FormatError(path, "", "the file has no header line");
}

int CsvTable::Find(std::initializer_list<const char*> names) const {
  for (const char* name : names) {
    const auto found = std::find(columns_.begin(), columns_.end(), name);
    if (found != columns_.end()) return static_cast<int>(found - columns_.begin());
  }
  return -1;
}

int CsvTable::Require(std::initializer_list<const char*> names) const {
  const int column = Find(names);
  if (column >= 0) return column;
  std::string have;
  for (const std::string& name : columns_) have += (have.empty() ? "" : ", ") + internal::Printable(name);
  throw FormatError(path_, "header", "no column '" + std::string(*names.begin()) + "'; there are " + have);
}

double CsvTable::Number(size_t row, int column) const {
  return internal::ParseNumber(Text(row, column), {path_, Where(row, column)});
}

int64_t CsvTable::Integer(size_t row, int column) const {
  const double number = Number(row, column);
  if (number != std::floor(number) || std::abs(number) > 0x1p53) {
    throw FormatError(path_, Where(row, column), "'" + internal::Printable(Text(row, column)) + "' is not a whole number");
  }
  return static_cast<int64_t>(number);
}

std::string CsvTable::Where(size_t row, int column) const {
  return Where(row) + ", " + internal::Printable(columns_[static_cast<size_t>(column)]);
}

}  // namespace mvstudio::calib
