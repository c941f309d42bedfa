#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/text/number_cell.h"
#include "dataset/arrays/child_process.h"
#include "dataset/arrays/foreign_hdf5.h"
#include "dataset/pose/deeplabcut_table.h"
#include "dataset/pose/marker_formats.h"
#include "dataset/pose/marker_programs.h"

namespace mvstudio::dataset::internal {
namespace {

/// A joint of an individual, and the columns with its place.
struct DeepLabCutPoint {
  int person = 0;
  std::string joint;
  int columns[3] = {-1, -1, -1};
};

std::vector<DeepLabCutPoint> DeepLabCutPoints(const std::string& path, const std::vector<DeepLabCutColumn>& columns) {
  std::vector<DeepLabCutPoint> points;
  std::vector<std::string> people;
  std::map<std::pair<std::string, std::string>, size_t> known;
  for (size_t c = 0; c < columns.size(); ++c) {
    const auto& [individual, joint, coord] = columns[c];
    if (coord.size() != 1 || coord[0] < 'x' || coord[0] > 'z') continue;
    if (std::find(people.begin(), people.end(), individual) == people.end()) people.push_back(individual);
    const auto [it, is_new] = known.emplace(std::pair(individual, joint), points.size());
    if (is_new) points.push_back({static_cast<int>(people.size()) - 1, joint});
    int& place = points[it->second].columns[coord[0] - 'x'];
    if (place >= 0) throw FormatError(path, "header", "`" + joint + "` has two columns " + coord);
    place = static_cast<int>(c);
  }
  for (const DeepLabCutPoint& point : points) {
    if (std::count(point.columns, point.columns + 3, -1) == 0) continue;
    throw FormatError(path, "header",
                      "`" + point.joint +
                          "` has no columns x, y and z: a result of one camera has x, y, likelihood and is "
                          "given as option 'pose2d' CAMERA=FILE");
  }
  if (points.empty()) throw FormatError(path, "header", "no column holds x, y, z of a joint");
  return points;
}

void AddDeepLabCutRow(int frame, const std::vector<DeepLabCutPoint>& points, const std::vector<double>& cells, double metres,
                      Pose3d* pose) {
  for (const DeepLabCutPoint& point : points) {
    const auto at = [&](int k) { return metres * cells[static_cast<size_t>(point.columns[k])]; };
    AddMarkerRow(frame, point.person, point.joint, {at(0), at(1), at(2)}, pose);
  }
}

void ReadDeepLabCutText(const std::string& path, double metres, Pose3d* pose) {
  const std::string text = ReadFile(path);
  CsvReader csv(path, text);
  const DeepLabCutHeader header = ReadDeepLabCutHeader(&csv);
  const std::vector<DeepLabCutPoint> points = DeepLabCutPoints(path, header.columns);
  std::vector<double> row(header.columns.size());
  while (csv.NextLine()) {
    const std::vector<std::string_view>& cells = csv.Cells();
    csv.RequireCells(header.width);
    const auto frame = WholeNumberCell(cells[header.num_index - 1]);
    if (!frame) csv.Fail("`" + std::string(cells[header.num_index - 1]) + "` is no frame");
    for (size_t c = 0; c < row.size(); ++c) {
      const NumberCell number = ReadNumberCell(cells[header.num_index + c]);
      if (number.kind == NumberCell::Kind::kOther) csv.Fail(WhyNoNumber(cells[header.num_index + c]));
      row[c] = number.value;
    }
    AddDeepLabCutRow(*frame, points, row, metres, pose);
  }
}

void ReadDeepLabCutFile(const std::string& path, double metres, Pose3d* pose) {
  const ForeignHdf5 file(path);
  const std::string group = FindPandasTable(file);
  if (group.empty()) file.Fail("/", "holds no table of DeepLabCut (df_with_missing)");
  const PandasTable table = ReadPandasTable(file, group);
  const std::vector<DeepLabCutPoint> points = DeepLabCutPoints(path, DeepLabCutColumns(file, table));
  std::vector<double> row(table.columns.size());
  for (size_t r = 0; r < table.index.size(); ++r) {
    for (size_t c = 0; c < row.size(); ++c) row[c] = table.values[c][r];
    AddDeepLabCutRow(DeepLabCutFrame(table.index[r], file, group + ", row " + std::to_string(r)), points, row, metres, pose);
  }
}

}  // namespace

bool IsDeepLabCutTable(std::string_view text) {
  if (text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
  return text.substr(0, 7) == "scorer," || text.substr(0, 9) == "\"scorer\",";
}

MarkerFile ReadDeepLabCutMarkers(const std::string& path, const std::string& unit) {
  MarkerFile file;
  file.pose.skeleton = "points", file.y_up = false;
  if (unit.empty())
    throw FormatError(path, "header",
                      "states no unit: DeepLabCut counts squares of the calibration board; give the side of one by option "
                      "'marker-unit', e.g. 25mm");
  file.unit = unit;
  file.notes.push_back(
      "its axes are kept: DeepLabCut's are those of its first camera after rectification, z forward, so that no axis is up "
      "(mvstudio markers: option 'up')");
  const double metres = MetresPerUnit(unit).value_or(1);
  if (std::filesystem::path(path).extension() == ".csv") {
    ReadDeepLabCutText(path, metres, &file.pose);
  } else {
    constexpr ChildLimits kLimits{120, 6ull << 30};
    RunInChild(path, kLimits, [&] {  // the library may crash on damaged files
      Pose3d tried;
      ReadDeepLabCutFile(path, 1, &tried);
      return std::string();
    });
    ReadDeepLabCutFile(path, metres, &file.pose);
  }
  if (file.pose.rows.empty()) throw FormatError(path, "", "no frames");
  SortByFrame(path, &file.pose);
  return file;
}

}  // namespace mvstudio::dataset::internal
