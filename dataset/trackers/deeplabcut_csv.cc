#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <string_view>

#include "core/csv.h"
#include "core/disk/pieces.h"
#include "core/error.h"
#include "core/text/number_cell.h"
#include "dataset/pose/pose2d_parse.h"
#include "dataset/trackers/tracker_readers.h"
#include "dataset/trackers/tracker_table.h"

namespace mvstudio::dataset::internal {
namespace {

using Names = std::vector<std::string>;

/// The header rows, by the word in their first cell.
struct Header {
  Names individuals, joints, coords;
  size_t num_index = 1;  ///< columns before the first coordinate: the frame, or three parts of an image's path
};

Header ReadHeader(CsvReader* csv) {
  constexpr int kMaxRows = 5;
  Header header;
  size_t width = 0;
  for (int row = 0; row < kMaxRows && header.coords.empty() && csv->NextLine(); ++row) {
    const std::vector<std::string_view>& cells = csv->Cells();
    if (row > 0) csv->RequireCells(width);
    width = cells.size();
    Names names(cells.begin(), cells.end());
    if (names[0] == "individuals")
      header.individuals = std::move(names);
    else if (names[0] == "bodyparts")
      header.joints = std::move(names);
    else if (names[0] == "coords")
      header.coords = std::move(names);
    else if (names[0] != "scorer")
      csv->Fail("`" + names[0] + "` is no header row of DeepLabCut: scorer, (individuals,) bodyparts, coords");
  }
  if (header.joints.empty() || header.coords.empty()) csv->Fail("the header rows bodyparts and coords are missing");
  while (header.num_index < width && header.coords[header.num_index].empty()) ++header.num_index;
  return header;
}

std::vector<TrackerColumn> Columns(const Header& header) {
  std::vector<TrackerColumn> columns;
  for (size_t c = header.num_index; c < header.coords.size(); ++c) {
    columns.push_back({header.individuals.empty() ? "" : header.individuals[c], header.joints[c], header.coords[c]});
  }
  return columns;
}

/// A number, or the number in the name of a labelled image.
int FrameOf(const CsvReader& csv, std::string_view cell) {
  std::string why;
  const int64_t frame = ReadFrameNumber(cell, std::numeric_limits<int>::max(), &why);
  if (frame >= 0) return static_cast<int>(frame);
  const std::string name = std::filesystem::path(cell).filename().string();
  const auto number = name.find('.') == std::string::npos ? std::nullopt : FrameNumber(name);
  if (!number) csv.Fail("the frame " + why + ", and no image's name with a number either");
  return *number;
}

double NumberOf(const CsvReader& csv, std::string_view cell) {
  const NumberCell number = ReadNumberCell(cell);
  if (number.kind != NumberCell::Kind::kOther) return number.value;
  csv.Fail("`" + std::string(cell) + "` is not a number" + DecimalCommaHint(cell));
}

}  // namespace

TrackedPoints ReadDeepLabCutCsv(const std::string& path, const std::string& camera) {
  FilePieces pieces(path);
  CsvReader csv(path, [&](std::string* text) { return pieces.Append(text); });
  const Header header = ReadHeader(&csv);
  const std::vector<TrackerColumn> columns = Columns(header);
  TrackerTable table(path, camera, "DeepLabCut", columns);
  std::vector<std::string> skipped;
  Tolerant tolerant(&skipped);
  std::vector<double> row(columns.size());
  while (csv.NextLine()) {
    tolerant.Try([&] {
      const std::vector<std::string_view>& cells = csv.Cells();
      csv.RequireCells(header.coords.size());
      const int frame = FrameOf(csv, cells[header.num_index - 1]);
      for (size_t c = 0; c < row.size(); ++c)
        row[c] = IsCoordinate(columns[c]) ? NumberOf(csv, cells[header.num_index + c]) : std::nan("");
      table.Add(frame, row, csv.Where());
    });
  }
  tolerant.Finish();
  TrackedPoints points = table.Finish();
  points.track.skipped = std::move(skipped);
  return points;
}

}  // namespace mvstudio::dataset::internal
