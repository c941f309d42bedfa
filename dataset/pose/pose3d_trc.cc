#include "dataset/pose/pose3d_trc.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>

#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio::dataset {
namespace {

constexpr double kMaxFrame = 1e9;
constexpr size_t kFreeRows = 100'000;

std::vector<std::string> SplitTabs(std::string line) {
  if (!line.empty() && line.back() == '\r') line.pop_back();
  std::vector<std::string> cells;
  std::istringstream stream(line);
  for (std::string cell; std::getline(stream, cell, '\t');) cells.push_back(cell);
  return cells;
}

double ParseNumber(const std::string& text) {
  double value = std::nan("");
  const size_t begin = std::min(text.find_first_not_of(' '), text.size());
  const auto [end, error] = std::from_chars(text.data() + begin, text.data() + text.size(), value);
  return error == std::errc() ? value : std::nan("");
}

/// The header's third line has values for the names of its second: … Units … over … m ….
std::string UnitOf(const std::vector<std::string>& names, const std::vector<std::string>& values, const std::string& path) {
  for (size_t i = 0; i < names.size() && i < values.size(); ++i) {
    if (names[i] != "Units") continue;
    if (MetresPerUnit(values[i])) return values[i];
    throw FormatError(path, "line 3", "unit `" + values[i] + "` is none of m, cm, mm and in; name it by option 'marker-unit'");
  }
  throw FormatError(path, "line 2", "no column `Units`; this is not a .trc file");
}

JointRow ToRow(int frame, const std::string& marker, const Eigen::Vector3d& in_file) {
  JointRow row;
  row.frame = frame;
  row.joint = marker;
  if (!in_file.allFinite()) return row;
  row.status = Status::kOk;
  row.x_in_world = {in_file.z(), in_file.x(), in_file.y()};
  return row;
}

}  // namespace

MarkerFile ReadTrcMarkers(const std::string& path, const std::string& unit) {
  const std::string text = ReadFile(path);
  std::istringstream stream(text);
  std::vector<std::vector<std::string>> header;
  std::string line;
  for (int i = 0; i < 5 && std::getline(stream, line); ++i) header.push_back(SplitTabs(line));
  if (header.size() < 5) throw FormatError(path, "header", "fewer than 5 lines; this is not a .trc file");
  MarkerFile file;
  file.unit = unit.empty() ? UnitOf(header[1], header[2], path) : unit;
  const double metres = MetresPerUnit(file.unit).value_or(1);
  std::vector<std::string> markers;
  for (size_t i = 2; i < header[3].size(); i += 3) {
    if (!header[3][i].empty()) markers.push_back(header[3][i]);
  }
  Pose3d& pose = file.pose;
  pose.skeleton = "points";
  for (int number = 6; std::getline(stream, line); ++number) {
    const std::vector<std::string> cells = SplitTabs(line);
    if (cells.empty() || cells[0].empty()) continue;
    const double frame = ParseNumber(cells[0]);
    if (!(frame >= 0 && frame <= kMaxFrame)) {
      throw FormatError(path, "line " + std::to_string(number), "`" + cells[0] + "` is not a frame number");
    }
    // Cells at a line's end may be left out, but not so many that a small file becomes a huge table.
    if (pose.rows.size() + markers.size() > text.size() + kFreeRows) {
      throw FormatError(path, "line " + std::to_string(number),
                        std::to_string(cells.size()) + " columns for " + std::to_string(markers.size()) + " markers");
    }
    for (size_t m = 0; m < markers.size(); ++m) {
      Eigen::Vector3d in_file;
      for (size_t k = 0; k < 3; ++k) {
        const size_t column = 2 + 3 * m + k;
        in_file[static_cast<Eigen::Index>(k)] = column < cells.size() ? metres * ParseNumber(cells[column]) : std::nan("");
      }
      pose.rows.push_back(ToRow(static_cast<int>(frame) - 1, markers[m], in_file));
    }
  }
  if (pose.rows.empty()) throw FormatError(path, "", "no frames");
  return file;
}

Pose3d ReadTrc(const std::string& path) { return ReadTrcMarkers(path).pose; }

}  // namespace mvstudio::dataset
