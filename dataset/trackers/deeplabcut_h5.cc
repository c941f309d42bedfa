#include "dataset/pose/deeplabcut_table.h"
#include "dataset/trackers/tracker_readers.h"
#include "dataset/trackers/tracker_table.h"

namespace mvstudio::dataset::internal {
namespace {

/// The pandas table of the file.
std::string FindTable(const ForeignHdf5& file) {
  std::string table = FindPandasTable(file);
  if (!table.empty()) return table;
  if (file.Has("/instances") && file.Has("/frames")) {
    file.Fail(
        "",
        "a SLEAP project (.slp); export each video in SLEAP (File > Export Analysis HDF5, or the program sleap-convert with "
        "format analysis) and give that file");
  }
  file.Fail("/", "neither a table of DeepLabCut (df_with_missing) nor SLEAP's analysis file (tracks, node_names)");
}

}  // namespace

TrackedPoints ReadDeepLabCutHdf5(const ForeignHdf5& file, const std::string& camera) {
  const PandasTable read = ReadPandasTable(file, FindTable(file));
  TrackerTable table(file.path(), camera, "DeepLabCut", DeepLabCutColumns(file, read));
  std::vector<double> row(read.columns.size());
  for (size_t r = 0; r < read.index.size(); ++r) {
    const std::string place = read.group + ", row " + std::to_string(r);
    for (size_t c = 0; c < row.size(); ++c) row[c] = read.values[c][r];
    table.Add(DeepLabCutFrame(read.index[r], file, place), row, place);
  }
  return table.Finish();
}

}  // namespace mvstudio::dataset::internal
