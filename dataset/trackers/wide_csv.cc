#include <algorithm>
#include <cctype>
#include <limits>

#include "core/csv.h"
#include "core/disk/files.h"
#include "core/text/number_cell.h"
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

constexpr std::string_view kScoreWords[] = {"score", "conf", "confidence", "likelihood", "visibility", "prob", "c", "p"};

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

/// The columns; z of MediaPipe is a depth beside x and y in the image, which its visibility tells from 3D points.
std::vector<TrackerColumn> JointColumns(const std::vector<std::string_view>& header) {
  const bool depths = std::any_of(header.begin(), header.end(), [](std::string_view name) {
    return SmallLetters(name).find("visibility") != std::string::npos;
  });
  std::vector<TrackerColumn> columns;
  for (const std::string_view name : header) {
    columns.push_back(JointColumn(name));
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

int FrameColumn(const std::vector<std::string_view>& header) {
  for (const char* name : {"frame", "frame_idx", "frame_number", "frame_id", "frame_index", "fnum", "index", ""}) {
    for (size_t c = 0; c < header.size(); ++c) {
      if (SmallLetters(header[c]) == name) return static_cast<int>(c);
    }
  }
  return -1;
}

}  // namespace

bool IsWideCsvHeader(std::string_view line) {
  std::vector<std::string> x, y;
  for (size_t at = 0; at <= line.size();) {
    const size_t end = std::min(line.find(',', at), line.size());
    std::string cell(line.substr(at, end - at));
    cell.erase(std::remove_if(cell.begin(), cell.end(), [](char c) { return c == '"'; }), cell.end());
    const TrackerColumn column = JointColumn(cell);
    if (column.coord == "x") x.push_back(column.joint);
    if (column.coord == "y") y.push_back(column.joint);
    at = end + 1;
  }
  return !x.empty() && x == y;
}

TrackedPoints ReadWideCsv(const std::string& path, const std::string& camera) {
  const std::string text = ReadFile(path);
  CsvReader csv(path, text);
  csv.NextLine();
  const std::vector<std::string_view> header = csv.Cells();
  const std::vector<TrackerColumn> columns = JointColumns(header);
  const int frame_column = FrameColumn(header);
  TrackerTable table(path, camera, "2D table", columns);
  std::vector<double> numbers(columns.size());
  std::vector<std::string> skipped;
  Tolerant tolerant(&skipped);
  for (int row = 0; csv.NextLine(); ++row) {
    tolerant.Try([&] {
      const std::vector<std::string_view>& cells = csv.Cells();
      csv.RequireCells(columns.size());
      std::string why;
      const int64_t frame =
          frame_column < 0 ? row
                           : ReadFrameNumber(cells[static_cast<size_t>(frame_column)], std::numeric_limits<int>::max(), &why);
      if (frame < 0) csv.Fail("the frame " + why);
      for (size_t c = 0; c < columns.size(); ++c) {
        if (!IsCoordinate(columns[c])) continue;
        const NumberCell number = ReadNumberCell(cells[c]);
        if (number.kind == NumberCell::Kind::kOther)
          csv.Fail("`" + std::string(cells[c].substr(0, 40)) + "` is not a number" + DecimalCommaHint(cells[c]));
        numbers[c] = number.value;
      }
      table.Add(static_cast<int>(frame), numbers, csv.Where());
    });
  }
  tolerant.Finish();
  TrackedPoints points = table.Finish();
  points.track.skipped = std::move(skipped);
  return points;
}

}  // namespace mvstudio::dataset::internal
