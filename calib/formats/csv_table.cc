#include "calib/formats/csv_table.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <string_view>

#include "calib/formats/format_text.h"
#include "core/csv.h"
#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio::calib {
namespace {

constexpr int64_t kMostWhole = int64_t{1} << 53;

std::string Trimmed(std::string_view text) {
  const size_t first = text.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos) return "";
  return std::string(text.substr(first, text.find_last_not_of(" \t\r\n") + 1 - first));
}

}  // namespace

CsvTable::CsvTable(const std::string& path) : path_(path) {
  const std::string text = ReadFile(path);
  CsvReader csv(path, text);
  while (csv.NextLine()) {
    if (csv.line()[0] == '#') {
      comments_.push_back({csv.line_number(), Trimmed(csv.line().substr(1))});
      continue;
    }
    std::vector<std::string> cells;
    for (const std::string_view cell : csv.Cells()) cells.push_back(Trimmed(cell));
    if (columns_.empty()) {
      columns_ = std::move(cells);
    } else {
      csv.RequireCells(columns_.size());
      rows_.push_back({csv.line_number(), std::move(cells)});
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
  const std::string& text = Text(row, column);
  int64_t whole = 0;
  const char* end = text.data() + text.size();
  const auto [at, error] = std::from_chars(text.data(), end, whole);  // exactly, where a double is not
  if (error == std::errc() && at == end && std::abs(whole) <= kMostWhole) return whole;
  const double number = Number(row, column);
  if (std::abs(number) > static_cast<double>(kMostWhole))
    throw FormatError(path_, Where(row, column), "'" + internal::Printable(text) + "' is larger than 2^53");
  if (number != std::floor(number))
    throw FormatError(path_, Where(row, column), "'" + internal::Printable(text) + "' is not a whole number");
  return static_cast<int64_t>(number);
}

int64_t CsvTable::Frame(size_t row, int column) const {
  std::string why;
  const int64_t frame = ReadFrameNumber(Text(row, column), kMostWhole, &why);
  if (frame < 0) throw FormatError(path_, Where(row, column), why);
  return frame;
}

std::string CsvTable::Where(size_t row, int column) const {
  return Where(row) + ", " + internal::Printable(columns_[static_cast<size_t>(column)]);
}

}  // namespace mvstudio::calib
