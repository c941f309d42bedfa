#include <algorithm>
#include <cctype>
#include <cmath>
#include <sstream>
#include <string_view>
#include <vector>

#include "calib/formats/format_camera.h"
#include "calib/formats/opencv_yaml.h"
#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio::calib::internal {
namespace {

[[noreturn]] void Fail(const Place& place, const std::string& what) { throw FormatError(place.path, place.where, what); }

double NumberOf(const Value& value, const Place& place) {
  if (value.kind == Value::Kind::kNumber) return value.number;
  Fail(place, "'" + Printable(value.text) + "' is not a finite number");
}

const Value* FindIn(const Value& table, std::string_view key) {
  for (const auto& [name, value] : table.entries) {
    if (name == key) return &value;
  }
  return nullptr;
}

/// `rows` or `cols` of a matrix.
int SizeOf(const Entry& entry, const char* key) {
  const Value* const value = FindIn(entry.value, key);
  if (!value) Fail(entry.place, "'" + std::string(key) + "' is missing in this matrix");
  const double number = NumberOf(*value, entry.place);
  if (!(number >= 0 && number <= 10000) || number != std::floor(number)) {
    Fail(entry.place, "'" + std::string(key) + "' is out of range");
  }
  return static_cast<int>(number);
}

}  // namespace

std::string NormalisedKey(const std::string& key) {
  std::string plain;
  for (const char c : key) {
    if (c != '_') plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return plain;
}

namespace {

/// YAML wants a blank behind a key's colon; OpenCV's reader does not, and files of ORB-SLAM2 have `Viewer.PointSize:2`.
std::string WithBlanks(const std::string& text) {
  const auto in_key = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '.' || c == '-'; };
  std::string out;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size() - 1) + 1;
    size_t at = text.find_first_not_of(" \t", begin);
    const size_t key = at;
    while (at < end && in_key(text[at])) ++at;
    const bool tight = at > key && at + 1 < end && text[at] == ':' && !std::isspace(static_cast<unsigned char>(text[at + 1]));
    out += text.substr(begin, tight ? at + 1 - begin : end - begin);
    if (tight) out += " " + text.substr(at + 1, end - at - 1);
    begin = end;
  }
  return out;
}

}  // namespace

void ReadEntries(const std::string& path, bool normalised, Entries* entries) {
  const std::string text = ReadFile(path);
  const bool is_xml = text.find("<opencv_storage") != std::string::npos;
  // ROS's camera_info and files written from Python have no head, but OpenCV's keys.
  const bool ros =
      normalised && (text.find("camera_matrix") != std::string::npos || text.find("cameraMatrix") != std::string::npos ||
                     text.find("mtx") != std::string::npos || IsCameraInfo(text) || IsJsonOfMatrices(text));
  const bool headed = text.compare(0, 5, "%YAML") == 0;
  if (!headed && !ros && !is_xml) throw FormatError(path, "line 1", "OpenCV's YAML files begin with %YAML:1.0");
  Value root = is_xml ? ParseOpenCvXml(path, text) : ParseYaml(path, headed ? WithBlanks(text) : text);
  if (root.kind == Value::Kind::kList) {
    Value cameras;
    cameras.kind = Value::Kind::kTable;
    cameras.entries.emplace_back("cam", std::move(root));
    root = std::move(cameras);
  }
  if (root.kind != Value::Kind::kTable) {
    throw FormatError(path, "line " + std::to_string(root.line), "'key: value' was expected; is the file truncated?");
  }
  for (auto& [key, value] : root.entries) {
    const std::string where = value.line > 0 ? "line " + std::to_string(value.line) : Printable(key);
    const auto [entry, is_new] = entries->insert({normalised ? NormalisedKey(key) : key, {}});
    if (!is_new) throw FormatError(path, where, "the key '" + Printable(key) + "' occurs twice");
    entry->second = {std::move(value), {path, Printable(key)}};
  }
}

double ReadNumber(const Entry& entry) { return NumberOf(entry.value, entry.place); }

namespace {

/// The numbers of `data: [ … ]`; some of ROS's files have blanks between them for commas.
std::vector<double> NumbersOf(const Value& data, const Place& place) {
  std::vector<double> numbers;
  for (const Value& item : data.items) {
    const bool blanks = data.items.size() == 1 && item.kind == Value::Kind::kText && item.text.find(' ') != std::string::npos;
    std::istringstream words(blanks ? item.text : std::string());
    for (std::string word; words >> word;) numbers.push_back(ParseNumber(word, place));
    const Place here{place.path, place.where + "[" + std::to_string(numbers.size()) + "]"};
    if (!blanks) numbers.push_back(NumberOf(item, here));
  }
  return numbers;
}

/// A plain list of numbers (9 are a 3x3 matrix, others a column), or a list of rows: ROS's camera_info, Python's YAML and JSON.
Eigen::MatrixXd ReadList(const Entry& entry) {
  const ValueView view(entry.place.path, entry.value, entry.place.where);
  const size_t size = view.ListSize();
  if (size > 0 && view[0].value().kind == Value::Kind::kList) return view.Matrix(size, view[0].ListSize());
  const Eigen::VectorXd numbers = view.Vector();
  if (size != 9) return numbers;
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.data());
}

}  // namespace

Eigen::MatrixXd ReadMatrix(const Entry& entry) {
  if (entry.value.kind == Value::Kind::kList) return ReadList(entry);
  if (entry.value.kind != Value::Kind::kTable) Fail(entry.place, "an !!opencv-matrix was expected");
  const int rows = SizeOf(entry, "rows"), cols = SizeOf(entry, "cols");
  const Value* const data = FindIn(entry.value, "data");
  if (!data || data->kind != Value::Kind::kList) Fail(entry.place, "the numbers in [ ] are missing; is the file truncated?");
  const std::vector<double> numbers = NumbersOf(*data, entry.place);
  const size_t count = numbers.size();
  const bool counted = rows == 1 && cols == 5 && count == 8;  // ROS's calibrator once wrote 5 for every lens
  if (count != static_cast<size_t>(rows) * static_cast<size_t>(cols) && !counted)
    Fail(entry.place, std::to_string(count) + " numbers for " + std::to_string(rows) + " x " + std::to_string(cols));
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const RowMajor>(numbers.data(), rows, counted ? 8 : cols);
}

bool IsCameraInfo(std::string_view text) {
  const auto has = [&](const char* key) { return text.find(key) != std::string_view::npos; };
  return has("distortion_model:") && (has("\nk:") || has("\nK:")) && (has("\nd:") || has("\nD:"));
}

namespace {

/// Whether a list stands under a key of JSON, somewhere.
bool HoldsList(std::string_view text, std::string_view key) {
  for (size_t at = text.find(key); at != std::string_view::npos; at = text.find(key, at + 1)) {
    const size_t value = text.find_first_not_of(" \t\r\n:", at + key.size());
    if (value != std::string_view::npos && text[value] == '[') return true;
  }
  return false;
}

}  // namespace

bool IsJsonOfMatrices(std::string_view text) {
  const auto has = [&](const char* key) { return text.find(key) != std::string_view::npos; };
  const size_t start = text.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  if (start == std::string_view::npos || (text[start] != '{' && text[start] != '[')) return false;
  return has("\"camera_matrix") || has("\"cameraMatrix") || has("\"mtx") || (has("\"K\"") && (has("\"dist") || has("\"D\""))) ||
         (has("\"matrix\"") && has("\"distortions\"")) ||
         (HoldsList(text, "\"intrinsics\"") &&
          (HoldsList(text, "\"extrinsics\"") || HoldsList(text, "\"extrinsic\"") || has("\"R\"")));
}

const Entry* FindEntry(const Entries& entries, const std::string& key) {
  const auto found = entries.find(key);
  if (found == entries.end()) return nullptr;
  found->second.value.used = true;
  return &found->second;
}

geometry::LensWords LensWordsOf(const Entries& entries) {
  geometry::LensWords words;
  for (const auto& [key, entry] : entries) {
    if (!geometry::LensWords::IsKey(key)) continue;
    entry.value.used = true;
    words.Add(entry.place.path, entry.place.where, key, TextOf(entry.value));
  }
  return words;
}

void AddUnusedEntries(const Entries& entries, std::initializer_list<const char*> harmless, geometry::UnusedKeys* unused) {
  for (const auto& [key, entry] : entries) {
    if (entry.value.used || std::find(harmless.begin(), harmless.end(), geometry::PlainKey(key)) != harmless.end()) continue;
    unused->Add(entry.place.where, key, TextOf(entry.value));
  }
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
  if (matrix.size() == 3) return RotationFromVector(Eigen::Vector3d(ReadVector(entry)), entry.place);
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
