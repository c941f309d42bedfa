#include "calib/board/board_points.h"

#include <array>
#include <limits>
#include <map>
#include <vector>

#include "core/csv.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/text/number_cell.h"
#include "core/text/words.h"

namespace mvstudio::calib {
namespace {

constexpr int kMostPoints = 100'000;

/// Where the id and the coordinates stand, and the unit of the latter.
struct Columns {
  int id = -1;
  std::array<int, 3> xyz = {-1, -1, -1};
  std::optional<double> unit_m;
};

Columns ColumnsOf(CsvReader* csv) {
  const std::map<std::string, double> units = {{"", 1}, {"m", 1}, {"mm", 1e-3}, {"cm", 1e-2}, {"in", 0.0254}};
  Columns columns;
  const auto cells = csv->Cells();
  for (size_t c = 0; c < cells.size(); ++c) {
    const std::string name = PlainWord(cells[c]);
    if (name == "id" || name == "point" || name == "corner") columns.id = static_cast<int>(c);
    const size_t axis = name.empty() ? std::string::npos : std::string("xyz").find(name[0]);
    const auto unit = axis == std::string::npos ? units.end() : units.find(name.substr(1));
    if (unit == units.end()) continue;
    if (columns.unit_m.value_or(unit->second) != unit->second) csv->Fail("x, y and z have different units");
    columns.xyz[axis] = static_cast<int>(c);
    columns.unit_m = unit->second;
  }
  for (const int at : columns.xyz) {
    if (at < 0) csv->Fail("the header of a board's points is id,x,y,z (x_mm,y_mm,z_mm for millimetres)");
  }
  return columns;
}

/// The next line that is no comment.
bool NextRow(CsvReader* csv) {
  while (csv->NextLine()) {
    if (csv->line()[0] != '#') return true;
  }
  return false;
}

Eigen::Vector3d PointOf(const CsvReader& csv, const std::vector<std::string_view>& cells, const Columns& columns) {
  Eigen::Vector3d point;
  for (size_t axis = 0; axis < 3; ++axis) {
    const std::string_view text = cells[static_cast<size_t>(columns.xyz[axis])];
    const NumberCell cell = ReadNumberCell(text);
    if (cell.kind != NumberCell::Kind::kNumber) csv.Fail("'" + std::string(text) + "' is " + WhyNoNumber(text));
    point[static_cast<Eigen::Index>(axis)] = cell.value;
  }
  return point;
}

}  // namespace

Eigen::Matrix3Xd ReadBoardPoints(const std::string& path, std::optional<double> unit_m) {
  const std::string text = ReadFile(path);
  CsvReader csv(path, text);
  if (!NextRow(&csv)) throw FormatError(path, "", "the file is empty; a board's points are a table id,x,y,z");
  const size_t num_cells = csv.Cells().size();
  const Columns columns = ColumnsOf(&csv);
  std::map<int, Eigen::Vector3d> points;
  while (NextRow(&csv)) {
    const auto& cells = csv.Cells();
    csv.RequireCells(num_cells);
    int id = static_cast<int>(points.size());
    if (columns.id >= 0) {
      const std::string_view cell = cells[static_cast<size_t>(columns.id)];
      id = WholeNumberCell(cell, kMostPoints).value_or(-1);
      if (id < 0) csv.Fail("the id '" + std::string(cell) + "' is no whole number from 0 to " + std::to_string(kMostPoints));
    }
    if (!points.emplace(id, PointOf(csv, cells, columns)).second) csv.Fail("the id " + std::to_string(id) + " comes twice");
  }
  if (points.size() < 4)
    throw FormatError(path, "", "a board needs 4 points or more, these are " + std::to_string(points.size()));
  Eigen::Matrix3Xd all(3, points.size());
  int next = 0;
  for (const auto& [id, point] : points) {
    if (id != next)
      throw FormatError(
          path, "",
          "the ids must be 0 to " + std::to_string(points.size() - 1) + ", each once; " + std::to_string(next) + " is missing");
    all.col(next++) = point * unit_m.value_or(*columns.unit_m);
  }
  return all;
}

}  // namespace mvstudio::calib
