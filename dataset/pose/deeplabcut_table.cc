#include "dataset/pose/deeplabcut_table.h"

#include <cmath>

#include "core/error.h"
#include "dataset/arrays/foreign_hdf5.h"

namespace mvstudio::dataset::internal {

DeepLabCutHeader ReadDeepLabCutHeader(CsvReader* csv) {
  constexpr int kMaxRows = 5;
  using Names = std::vector<std::string>;
  Names individuals, joints, coords;
  DeepLabCutHeader header;
  for (int row = 0; row < kMaxRows && coords.empty() && csv->NextLine(); ++row) {
    const std::vector<std::string_view>& cells = csv->Cells();
    if (row > 0) csv->RequireCells(header.width);
    header.width = cells.size();
    Names names(cells.begin(), cells.end());
    if (names[0] == "individuals")
      individuals = std::move(names);
    else if (names[0] == "bodyparts")
      joints = std::move(names);
    else if (names[0] == "coords")
      coords = std::move(names);
    else if (names[0] != "scorer")
      csv->Fail("`" + names[0] + "` is no header row of DeepLabCut: scorer, (individuals,) bodyparts, coords");
  }
  if (joints.empty() || coords.empty()) csv->Fail("the header rows bodyparts and coords are missing");
  while (header.num_index < header.width && coords[header.num_index].empty()) ++header.num_index;
  for (size_t c = header.num_index; c < coords.size(); ++c)
    header.columns.push_back({individuals.empty() ? "" : individuals[c], joints[c], coords[c]});
  return header;
}

std::vector<DeepLabCutColumn> DeepLabCutColumns(const ForeignHdf5& file, const PandasTable& table) {
  std::vector<DeepLabCutColumn> columns;
  for (const std::vector<std::string>& levels : table.columns) {
    if (levels.size() != 3 && levels.size() != 4) {
      file.Fail(table.group,
                std::to_string(levels.size()) +
                    " header rows instead of scorer, (individuals,) bodyparts, coords; is it a file of DeepLabCut?");
    }
    const size_t joint = levels.size() - 2;
    columns.push_back({joint == 2 ? levels[1] : "", levels[joint], levels[joint + 1]});
  }
  return columns;
}

int DeepLabCutFrame(double index, const ForeignHdf5& file, const std::string& place) {
  constexpr double kMaxFrame = 1e9;
  if (!(index >= 0 && index < kMaxFrame && index == std::floor(index))) file.Fail(place, "is not a frame number");
  return static_cast<int>(index);
}

}  // namespace mvstudio::dataset::internal
