#include <algorithm>
#include <cmath>

#include "dataset/trackers/pickled_names.h"
#include "dataset/trackers/tracker_readers.h"
#include "dataset/trackers/tracker_table.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr char kCsvHint[] = "; write it as CSV: deeplabcut.analyze_videos_converth5_to_csv, or pandas' to_csv";

/// Columns with their numbers, as stored in one or several blocks.
struct Frame {
  std::vector<double> index;  ///< a frame number per row
  std::vector<TrackerColumn> columns;
  std::vector<std::vector<double>> values;  ///< of each column
};

/// Levels of a column's name: scorer, (individual,) joint, coord.
TrackerColumn ToColumn(const std::vector<std::string>& levels, const ForeignHdf5& file, const std::string& place) {
  if (levels.size() == 3) return {"", levels[1], levels[2]};
  if (levels.size() == 4) return {levels[1], levels[2], levels[3]};
  file.Fail(place, std::to_string(levels.size()) +
                       " header rows instead of scorer, (individuals,) bodyparts, coords; is it a file of DeepLabCut?");
}

void AddColumns(const std::vector<TrackerColumn>& columns, const std::vector<double>& row_major, Frame* frame) {
  for (size_t c = 0; c < columns.size(); ++c) {
    frame->columns.push_back(columns[c]);
    std::vector<double>& values = frame->values.emplace_back(frame->index.size());
    for (size_t r = 0; r < values.size(); ++r) values[r] = row_major[r * columns.size() + c];
  }
}

/// Format "table": one compound dataset; the names of each block's columns are pickled beside it.
Frame ReadTable(const ForeignHdf5& file, const std::string& group) {
  const std::string table = group + "/table";
  Frame frame;
  size_t per_row = 0;
  const std::vector<std::string> fields = file.Fields(table);
  if (std::find(fields.begin(), fields.end(), "index") == fields.end()) {
    file.Fail(table, std::string("has no column of frame numbers: labelled images, not a video's result") + kCsvHint);
  }
  frame.index = file.Field(table, "index", &per_row);
  if (per_row != 1) file.Fail(table + ".index", "holds several numbers a row");
  for (const std::string& field : fields) {
    if (field.rfind("values_block_", 0) != 0) continue;
    const std::string place = table + "@" + field + "_kind";
    const auto names = ReadPickledNames(file.TextAttribute(table, field + "_kind"));
    if (!names) file.Fail(place, std::string("holds other Python objects than names of columns") + kCsvHint);
    const std::vector<double> values = file.Field(table, field, &per_row);
    if (per_row != names->size()) {
      file.Fail(place, std::to_string(names->size()) + " names for " + std::to_string(per_row) + " columns");
    }
    std::vector<TrackerColumn> columns;
    for (const auto& levels : *names) columns.push_back(ToColumn(levels, file, place));
    AddColumns(columns, values, &frame);
  }
  return frame;
}

/// Names of a block of format "fixed": every level's names once, and for each column its place among them.
std::vector<TrackerColumn> FixedColumns(const ForeignHdf5& file, const std::string& block) {
  std::vector<std::vector<std::string>> names;
  for (int level = 0; file.Has(block + "_items_level" + std::to_string(level)); ++level) {
    const std::string place = block + "_items_label" + std::to_string(level);
    const std::vector<std::string> known = file.Texts(block + "_items_level" + std::to_string(level));
    const std::vector<double> labels = file.Numbers(place);
    if (level == 0) names.resize(labels.size());
    if (labels.size() != names.size()) file.Fail(place, "has another number of columns than the level before");
    for (size_t c = 0; c < labels.size(); ++c) {
      if (!(labels[c] >= 0 && labels[c] < static_cast<double>(known.size())))
        file.Fail(place, "names a level that is not there");
      names[c].push_back(known[static_cast<size_t>(labels[c])]);
    }
  }
  if (names.empty()) file.Fail(block + "_items_level0", "is missing: no header rows as DeepLabCut writes them");
  std::vector<TrackerColumn> columns;
  for (const auto& levels : names) columns.push_back(ToColumn(levels, file, block + "_items"));
  return columns;
}

Frame ReadFixed(const ForeignHdf5& file, const std::string& group) {
  Frame frame;
  if (!file.Has(group + "/axis1")) {
    file.Fail(group + "/axis1", std::string("is missing: labelled images, not a video's result") + kCsvHint);
  }
  frame.index = file.Numbers(group + "/axis1");
  for (int b = 0; file.Has(group + "/block" + std::to_string(b) + "_values"); ++b) {
    const std::string block = group + "/block" + std::to_string(b);
    const std::vector<TrackerColumn> columns = FixedColumns(file, block);
    const std::vector<uint64_t> dims = file.Dims(block + "_values");
    if (dims != std::vector<uint64_t>{frame.index.size(), columns.size()}) {
      file.Fail(block + "_values",
                "is not " + std::to_string(frame.index.size()) + " frames x " + std::to_string(columns.size()) + " columns");
    }
    AddColumns(columns, file.Numbers(block + "_values"), &frame);
  }
  return frame;
}

/// The pandas table of the file.
std::string FindTable(const ForeignHdf5& file) {
  std::vector<std::string> tables;
  for (const std::string& name : file.Members("/")) {
    if (file.HasAttribute("/" + name, "pandas_type")) tables.push_back("/" + name);
  }
  if (std::find(tables.begin(), tables.end(), "/df_with_missing") != tables.end()) return "/df_with_missing";
  if (tables.size() == 1) return tables[0];
  if (!tables.empty()) file.Fail("/", "holds several pandas tables and none is called df_with_missing");
  if (file.Has("/instances") && file.Has("/frames")) {
    file.Fail("",
              "a SLEAP project (.slp); export each video: File > Export Analysis HDF5, or "
              "sleap-convert --format analysis -o CAMERA.h5 PROJECT.slp, and give that file");
  }
  file.Fail("/", "neither a table of DeepLabCut (df_with_missing) nor SLEAP's analysis file (tracks, node_names)");
}

int FrameOf(double index, const ForeignHdf5& file, const std::string& place) {
  constexpr double kMaxFrame = 1e9;
  if (!(index >= 0 && index < kMaxFrame && index == std::floor(index))) file.Fail(place, "is not a frame number");
  return static_cast<int>(index);
}

}  // namespace

TrackedPoints ReadDeepLabCutHdf5(const ForeignHdf5& file, const std::string& camera) {
  const std::string group = FindTable(file), type = file.TextAttribute(group, "pandas_type");
  if (type != "frame_table" && type != "frame") {
    file.Fail(group, "is a pandas object of type `" + type + "`, not a table" + kCsvHint);
  }
  const Frame frame = type == "frame_table" ? ReadTable(file, group) : ReadFixed(file, group);
  TrackerTable table(file.path(), camera, "DeepLabCut", frame.columns);
  std::vector<double> row(frame.columns.size());
  for (size_t r = 0; r < frame.index.size(); ++r) {
    const std::string place = group + ", row " + std::to_string(r);
    for (size_t c = 0; c < row.size(); ++c) row[c] = frame.values[c][r];
    table.Add(FrameOf(frame.index[r], file, place), row, place);
  }
  return table.Finish();
}

}  // namespace mvstudio::dataset::internal
