#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

#include "core/csv.h"
#include "core/disk/files.h"
#include "core/text/number_cell.h"
#include "core/text/row_times.h"
#include "dataset/pose/pose2d_parse.h"
#include "dataset/trackers/tracker_readers.h"
#include "dataset/trackers/tracker_table.h"

namespace mvstudio::dataset::internal {
namespace {

std::string SmallLetters(std::string_view text) {
  std::string small(text);
  std::transform(small.begin(), small.end(), small.begin(), [](unsigned char c) { return std::tolower(c); });
  return small;
}

constexpr std::string_view kScoreWords[] = {"score", "conf", "confidence", "likelihood", "visibility",
                                            "vis",   "v",    "prob",       "c",          "p"};

/// "nose_x" taken apart; coord is empty for a column that is none of a joint's.
TrackerColumn JointColumn(std::string_view name) {
  constexpr std::string_view kPixels = "_px";
  if (name.size() > kPixels.size() && name.substr(name.size() - kPixels.size()) == kPixels) name.remove_suffix(kPixels.size());
  const size_t between = name.find_last_of("_. :");
  if (between == std::string_view::npos || between == 0) return {};
  std::string coord = SmallLetters(name.substr(between + 1));
  const bool score = std::find(std::begin(kScoreWords), std::end(kScoreWords), coord) != std::end(kScoreWords);
  if (score) coord = "likelihood";
  if (coord != "x" && coord != "y" && coord != "z" && !score) return {};
  return {"", std::string(name.substr(0, between)), coord};
}

/// "x_nose" taken apart, as JointColumn takes "nose_x".
TrackerColumn PrefixedColumn(std::string_view name) {
  const size_t between = name.find_first_of("_. :");
  if (between == std::string_view::npos || between + 1 >= name.size()) return {};
  TrackerColumn column = JointColumn(std::string(name.substr(between + 1)) + "_" + std::string(name.substr(0, between)));
  const std::string of = SmallLetters(column.joint);  // x_m and x_center are places of something else
  for (const char* word : {"m", "mm", "cm", "px", "pixel", "world", "norm", "center", "centre", "min", "max", "mean"}) {
    if (of == word) return {};
  }
  return column;
}

/// Whether a header has its joints behind x and y: three at least, and none before.
bool IsPrefixed(const std::vector<std::string>& names) {
  std::vector<std::string> x, y;
  for (const std::string& name : names) {
    if (JointColumn(name).coord == "x") return false;
    const TrackerColumn column = PrefixedColumn(name);
    if (column.coord == "x") x.push_back(column.joint);
    if (column.coord == "y") y.push_back(column.joint);
  }
  return x.size() >= 3 && x == y;
}

TrackerColumn ColumnOf(const std::string& name, bool prefixed) { return prefixed ? PrefixedColumn(name) : JointColumn(name); }

/// The columns; z of MediaPipe is a depth beside x and y in the image, which its visibility tells from 3D points.
std::vector<TrackerColumn> JointColumns(const std::vector<std::string_view>& header) {
  const bool depths = std::any_of(header.begin(), header.end(), [](std::string_view name) {
    const std::string small = SmallLetters(name);
    const size_t between = small.find_last_of("_. :");
    const std::string last = between == std::string::npos ? "" : small.substr(between + 1);
    return small.find("visibility") != std::string::npos || small.rfind("v_", 0) == 0 || last == "v" || last == "vis";
  });
  std::vector<TrackerColumn> columns;
  const bool prefixed = IsPrefixed({header.begin(), header.end()});
  for (const std::string_view name : header) {
    columns.push_back(ColumnOf(std::string(name), prefixed));
    if (depths && columns.back().coord == "z") columns.back() = {};
  }
  // A score of something that has no x, such as the person's, is no joint's.
  for (TrackerColumn& column : columns) {
    const bool placed = std::any_of(columns.begin(), columns.end(), [&](const TrackerColumn& other) {
      return other.coord == "x" && other.joint == column.joint;
    });
    if (column.coord == "likelihood" && !placed) column = {};
  }
  return columns;
}

/// The first column whose name, in small letters, is one of `names`; -1: none.
int FindColumn(const std::vector<std::string_view>& header, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    for (size_t c = 0; c < header.size(); ++c) {
      if (SmallLetters(header[c]) == name) return static_cast<int>(c);
    }
  }
  return -1;
}

/// What says which frame, and which of several people, a row is of; -1: no such column.
struct RowColumns {
  int frame = -1, index = -1, time = -1, person = -1, camera = -1;

  explicit RowColumns(const std::vector<std::string_view>& header)
      : frame(FindColumn(header, {"frame", "frame_idx", "frame_number", "frame_id", "frame_index", "fnum"})),
        index(FindColumn(header, {"index", ""})),
        person(FindColumn(header, {"person", "person_id", "person_idx", "track", "track_id", "object_id", "id"})),
        camera(FindColumn(header, {"camera", "cam", "view", "camera_name", "camera_id"})) {
    const auto found = std::find_if(header.begin(), header.end(), IsTimeColumn);
    if (found != header.end()) time = static_cast<int>(found - header.begin());
  }
};

struct WideRow {
  std::string place, camera;
  int64_t number = -1;  ///< by the column of frames or the index; else of the row
  double time = 0;
  std::vector<double> numbers;
};

WideRow ReadWideRow(CsvReader* csv, const RowColumns& where, const std::vector<TrackerColumn>& columns, int row) {
  const std::vector<std::string_view>& cells = csv->Cells();
  csv->RequireCells(columns.size());
  const auto number_in = [&](size_t c) {
    const NumberCell number = ReadNumberCell(cells[c]);
    if (number.kind == NumberCell::Kind::kOther)
      csv->Fail("`" + std::string(cells[c].substr(0, 40)) + "` is not a number" + DecimalCommaHint(cells[c]));
    return number.value;
  };
  WideRow read{csv->Where(), "", row, 0, std::vector<double>(columns.size())};
  if (where.camera >= 0) read.camera = cells[static_cast<size_t>(where.camera)];
  const int numbered = where.frame >= 0 ? where.frame : where.index;
  std::string why;
  if (numbered >= 0) read.number = ReadFrameNumber(cells[static_cast<size_t>(numbered)], std::numeric_limits<int>::max(), &why);
  if (read.number < 0) csv->Fail("the frame " + why);
  if (where.frame < 0 && where.time >= 0) read.time = number_in(static_cast<size_t>(where.time));
  for (size_t c = 0; c < columns.size(); ++c) {
    if (IsCoordinate(columns[c])) read.numbers[c] = number_in(c);
  }
  return read;
}

void RequireOneCamera(const std::string& path, const std::vector<WideRow>& rows) {
  for (const WideRow& row : rows) {
    if (row.camera != rows.front().camera)
      throw FormatError(path, row.place,
                        "is of camera `" + row.camera.substr(0, 40) + "`, rows before are of `" +
                            rows.front().camera.substr(0, 40) + "`: give a table for each camera, option 'pose2d' NAME=FILE");
  }
}

/// Rows that have a time, and no number but their own place, are numbered by the time. Returns the step, 0: they are not.
double NumberByTimes(const std::string& path, const RowColumns& where, std::vector<WideRow>* rows) {
  if (where.frame >= 0 || where.time < 0) return 0;
  std::vector<double> times;
  bool counted = true;
  for (size_t i = 0; i < rows->size(); ++i) {
    times.push_back((*rows)[i].time);
    counted &= (*rows)[i].number == static_cast<int64_t>(i);
  }
  if (!counted) return 0;  // an index that skips rows is theirs
  std::string why;
  const std::optional<RowFrames> found = FramesOfTimes(times, &why);
  if (!found && where.index >= 0) return 0;
  if (!found)
    throw FormatError(path, "times",
                      why + ", and there is no column `frame`: add one, with the number of the image in the footage");
  for (size_t i = 0; i < rows->size(); ++i) (*rows)[i].number = found->frames[i];
  return found->step;
}

std::vector<TrackerColumn> ColumnsOfLine(std::string_view line) {
  std::vector<std::string> cells;
  for (size_t at = 0; at <= line.size();) {
    const size_t end = std::min(line.find(',', at), line.size());
    std::string cell(line.substr(at, end - at));
    cell.erase(std::remove_if(cell.begin(), cell.end(), [](char c) { return c == '"'; }), cell.end());
    cells.push_back(std::move(cell));
    at = end + 1;
  }
  const bool prefixed = IsPrefixed(cells);
  std::vector<TrackerColumn> columns;
  for (const std::string& cell : cells) columns.push_back(ColumnOf(cell, prefixed));
  return columns;
}

}  // namespace

bool IsWideCsvHeader(std::string_view line) {
  std::vector<std::string> x, y;
  for (const TrackerColumn& column : ColumnsOfLine(line)) {
    if (column.coord == "x") x.push_back(column.joint);
    if (column.coord == "y") y.push_back(column.joint);
  }
  return !x.empty() && x == y;
}

bool NamesSeveralCameras(std::string_view line) {
  std::set<std::string> cameras;
  for (const TrackerColumn& column : ColumnsOfLine(line)) {
    if (column.coord != "x") continue;
    const std::string joint = SmallLetters(column.joint);
    const size_t cam = joint.rfind("_cam"), digits = joint.find_last_not_of("0123456789") + 1;
    if (cam == std::string::npos || digits == joint.size() ||
        (digits != cam + 4 && joint.substr(cam) != "_cam_" + joint.substr(digits)))
      return false;
    cameras.insert(joint.substr(digits));
  }
  return cameras.size() > 1;
}

TrackedPoints ReadWideCsv(const std::string& path, const std::string& camera) {
  const std::string text = ReadFile(path);
  CsvReader csv(path, text);
  csv.NextLine();
  const std::vector<std::string_view> header = csv.Cells();
  const std::vector<TrackerColumn> columns = JointColumns(header);
  const RowColumns where(header);
  TrackerTable table(path, camera, "2D table", columns);
  std::vector<WideRow> rows;
  std::vector<std::string> skipped;
  Tolerant tolerant(&skipped);
  for (int row = 0; csv.NextLine(); ++row) tolerant.Try([&] { rows.push_back(ReadWideRow(&csv, where, columns, row)); });
  tolerant.Finish();
  RequireOneCamera(path, rows);
  const double step = NumberByTimes(path, where, &rows);
  Tolerant adding(&skipped);
  for (const WideRow& row : rows)
    adding.Try([&] { table.Add(static_cast<int>(row.number), row.numbers, row.place, where.person >= 0); });
  adding.Finish();
  TrackedPoints points = table.Finish();
  points.track.skipped = std::move(skipped);
  points.time_step = step;
  return points;
}

}  // namespace mvstudio::dataset::internal
