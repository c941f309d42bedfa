#include "dataset/arrays/pandas_table.h"

#include <algorithm>

#include "dataset/arrays/foreign_hdf5.h"
#include "dataset/arrays/pickled_names.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr char kCsvHint[] = "; write it as CSV: deeplabcut.analyze_videos_converth5_to_csv, or pandas' to_csv";

void AddColumns(const std::vector<std::vector<std::string>>& columns, const std::vector<double>& row_major,
                PandasTable* table) {
  for (size_t c = 0; c < columns.size(); ++c) {
    table->columns.push_back(columns[c]);
    std::vector<double>& values = table->values.emplace_back(table->index.size());
    for (size_t r = 0; r < values.size(); ++r) values[r] = row_major[r * columns.size() + c];
  }
}

/// Format "table": one compound dataset; the names of each block's columns are pickled beside it.
void ReadTable(const ForeignHdf5& file, PandasTable* out) {
  const std::string table = out->group + "/table";
  size_t per_row = 0;
  const std::vector<std::string> fields = file.Fields(table);
  if (std::find(fields.begin(), fields.end(), "index") == fields.end())
    file.Fail(table, std::string("has no column of frame numbers: labelled images, not a video's result") + kCsvHint);
  out->index = file.Field(table, "index", &per_row);
  if (per_row != 1) file.Fail(table + ".index", "holds several numbers a row");
  for (const std::string& field : fields) {
    if (field.rfind("values_block_", 0) != 0) continue;
    const std::string place = table + "@" + field + "_kind";
    const auto names = ReadPickledNames(file.TextAttribute(table, field + "_kind"));
    if (!names) file.Fail(place, std::string("holds other Python objects than names of columns") + kCsvHint);
    const std::vector<double> values = file.Field(table, field, &per_row);
    if (per_row != names->size())
      file.Fail(place, std::to_string(names->size()) + " names for " + std::to_string(per_row) + " columns");
    AddColumns(*names, values, out);
  }
}

/// Names of a block of format "fixed": every level's names once, and for each column its place among them.
std::vector<std::vector<std::string>> FixedColumns(const ForeignHdf5& file, const std::string& block) {
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
  return names;
}

void ReadFixed(const ForeignHdf5& file, PandasTable* out) {
  if (!file.Has(out->group + "/axis1"))
    file.Fail(out->group + "/axis1", std::string("is missing: labelled images, not a video's result") + kCsvHint);
  out->index = file.Numbers(out->group + "/axis1");
  for (int b = 0; file.Has(out->group + "/block" + std::to_string(b) + "_values"); ++b) {
    const std::string block = out->group + "/block" + std::to_string(b);
    const std::vector<std::vector<std::string>> columns = FixedColumns(file, block);
    const std::vector<uint64_t> dims = file.Dims(block + "_values");
    if (dims != std::vector<uint64_t>{out->index.size(), columns.size()}) {
      file.Fail(block + "_values",
                "is not " + std::to_string(out->index.size()) + " frames x " + std::to_string(columns.size()) + " columns");
    }
    AddColumns(columns, file.Numbers(block + "_values"), out);
  }
}

}  // namespace

std::string FindPandasTable(const ForeignHdf5& file) {
  std::vector<std::string> tables;
  for (const std::string& name : file.Members("/")) {
    if (file.HasAttribute("/" + name, "pandas_type")) tables.push_back("/" + name);
  }
  if (std::find(tables.begin(), tables.end(), "/df_with_missing") != tables.end()) return "/df_with_missing";
  if (tables.size() > 1) file.Fail("/", "holds several pandas tables and none is called df_with_missing");
  return tables.empty() ? "" : tables[0];
}

PandasTable ReadPandasTable(const ForeignHdf5& file, const std::string& group) {
  const std::string type = file.TextAttribute(group, "pandas_type");
  if (type != "frame_table" && type != "frame")
    file.Fail(group, "is a pandas object of type `" + type + "`, not a table" + kCsvHint);
  PandasTable table;
  table.group = group;
  if (type == "frame_table")
    ReadTable(file, &table);
  else
    ReadFixed(file, &table);
  return table;
}

}  // namespace mvstudio::dataset::internal
