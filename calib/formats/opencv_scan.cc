#include <cctype>
#include <cmath>
#include <sstream>

#include "calib/formats/opencv_internal.h"
#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio::calib::internal {
namespace {

std::string Normalised(const std::string& key) {
  std::string plain;
  for (const char c : key) {
    if (c != '_') plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return plain;
}

std::string Trimmed(const std::string& text) {
  const size_t first = text.find_first_not_of(" \t\r\n");
  return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(" \t\r\n") + 1 - first);
}

/// The number behind `key:` in the block of a matrix.
int BlockInteger(const Entry& entry, const std::string& key) {
  const size_t at = entry.block.find(key + ":");
  const size_t start = at == std::string::npos ? at : at + key.size() + 1;
  const size_t end = start == std::string::npos ? start : entry.block.find('\n', start);
  if (end == std::string::npos)
    throw FormatError(entry.place.path, entry.place.where, "'" + key + "' is missing in this matrix");
  const double number = ParseNumber(entry.block.substr(start, end - start), entry.place);
  if (!(number >= 0 && number <= 10000) || number != std::floor(number)) {
    throw FormatError(entry.place.path, entry.place.where, "'" + key + "' is out of range");
  }
  return static_cast<int>(number);
}

}  // namespace

void ReadEntries(const std::string& path, bool normalised, Entries* entries) {
  std::istringstream lines(ReadFile(path));
  std::string line;
  if (!std::getline(lines, line) || line.compare(0, 5, "%YAML") != 0) {
    throw FormatError(path, "line 1", "OpenCV's YAML files begin with %YAML:1.0");
  }
  Entry* current = nullptr;
  for (int number = 2; std::getline(lines, line); ++number) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line[0] == '#' || line.compare(0, 3, "---") == 0 || line.compare(0, 3, "...") == 0) continue;
    if (line[0] == ' ' || line[0] == '\t' || line[0] == '-') {
      if (current) current->block += line + "\n";
      continue;
    }
    const std::string where = "line " + std::to_string(number);
    const size_t colon = line.find(':');
    if (colon == std::string::npos) throw FormatError(path, where, "'key: value' was expected; is the file truncated?");
    const auto [entry, is_new] = entries->insert({normalised ? Normalised(line.substr(0, colon)) : line.substr(0, colon), {}});
    if (!is_new) throw FormatError(path, where, "the key '" + Printable(line.substr(0, colon)) + "' stands twice");
    current = &entry->second;
    current->value = Trimmed(line.substr(colon + 1));
    current->place = {path, Printable(line.substr(0, colon))};
  }
}

Eigen::MatrixXd ReadMatrix(const Entry& entry) {
  const auto fail = [&](const std::string& what) { throw FormatError(entry.place.path, entry.place.where, what); };
  if (entry.value.compare(0, 15, "!!opencv-matrix") != 0) fail("an !!opencv-matrix was expected");
  const int rows = BlockInteger(entry, "rows"), cols = BlockInteger(entry, "cols");
  const size_t open = entry.block.find('['), close = entry.block.find(']');
  if (open == std::string::npos || close == std::string::npos || close < open)
    fail("the numbers in [ ] are incomplete; is the file truncated?");
  std::vector<double> numbers;
  std::istringstream data(entry.block.substr(open + 1, close - open - 1));
  for (std::string item; std::getline(data, item, ',');) {
    const Place place{entry.place.path, entry.place.where + "[" + std::to_string(numbers.size()) + "]"};
    numbers.push_back(ParseNumber(item, place));
  }
  if (numbers.size() != static_cast<size_t>(rows) * cols) {
    fail(std::to_string(numbers.size()) + " numbers for " + std::to_string(rows) + " x " + std::to_string(cols));
  }
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(numbers.data(), rows, cols);
}

const Entry* FindEntry(const Entries& entries, const std::string& key) {
  const auto found = entries.find(key);
  return found == entries.end() ? nullptr : &found->second;
}

const Entry* FindFirst(const Entries& entries, std::initializer_list<const char*> keys) {
  for (const char* key : keys) {
    if (const Entry* entry = FindEntry(entries, key)) return entry;
  }
  return nullptr;
}

Eigen::Matrix3d ReadMatrix3(const Entry& entry) {
  const Eigen::MatrixXd matrix = ReadMatrix(entry);
  if (matrix.rows() != 3 || matrix.cols() != 3)
    throw FormatError(entry.place.path, entry.place.where, "a 3x3 matrix was expected");
  return matrix;
}

Eigen::VectorXd ReadVector(const Entry& entry) {
  const Eigen::MatrixXd matrix = ReadMatrix(entry);
  if (matrix.rows() != 1 && matrix.cols() != 1) throw FormatError(entry.place.path, entry.place.where, "a vector was expected");
  return Eigen::Map<const Eigen::VectorXd>(matrix.data(), matrix.size());
}

Eigen::VectorXd ReadDistortion(const Entry* entry) {
  if (!entry) return Eigen::VectorXd();
  Eigen::VectorXd distortion = ReadVector(*entry);
  for (const Eigen::Index count : {12, 8}) {
    if (distortion.size() > count && distortion.tail(distortion.size() - count).isZero(0)) distortion.conservativeResize(count);
  }
  return distortion;
}

Eigen::Quaterniond ReadRotation(const Entry& entry) {
  const Eigen::MatrixXd matrix = ReadMatrix(entry);
  if (matrix.size() == 3) return geometry::RotationExp(ReadVector(entry));
  return MakeRotation(ReadMatrix3(entry), entry.place);
}

std::string MatrixEntry(const std::string& key, const Eigen::MatrixXd& matrix) {
  std::string text = key + ": !!opencv-matrix\n   rows: " + std::to_string(matrix.rows()) +
                     "\n   cols: " + std::to_string(matrix.cols()) + "\n   dt: d\n   data: [ ";
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    if (i) text += ",\n       ";
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) text += (j ? ", " : "") + NumberText(matrix(i, j));
  }
  return text + " ]\n";
}

}  // namespace mvstudio::calib::internal
