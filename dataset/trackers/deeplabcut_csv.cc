#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <string_view>

#include "core/csv.h"
#include "core/disk/pieces.h"
#include "core/error.h"
#include "core/text/number_cell.h"
#include "dataset/pose/deeplabcut_table.h"
#include "dataset/pose/pose2d_parse.h"
#include "dataset/trackers/tracker_readers.h"
#include "dataset/trackers/tracker_table.h"

namespace mvstudio::dataset::internal {
namespace {

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
  const DeepLabCutHeader header = ReadDeepLabCutHeader(&csv);
  TrackerTable table(path, camera, "DeepLabCut", header.columns);
  std::vector<std::string> skipped;
  Tolerant tolerant(&skipped);
  std::vector<double> row(header.columns.size());
  while (csv.NextLine()) {
    tolerant.Try([&] {
      const std::vector<std::string_view>& cells = csv.Cells();
      csv.RequireCells(header.width);
      const int frame = FrameOf(csv, cells[header.num_index - 1]);
      for (size_t c = 0; c < row.size(); ++c)
        row[c] = IsCoordinate(header.columns[c]) ? NumberOf(csv, cells[header.num_index + c]) : std::nan("");
      table.Add(frame, row, csv.Where());
    });
  }
  tolerant.Finish();
  TrackedPoints points = table.Finish();
  points.track.skipped = std::move(skipped);
  return points;
}

}  // namespace mvstudio::dataset::internal
