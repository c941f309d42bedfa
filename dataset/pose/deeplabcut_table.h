// Private: for the readers of DeepLabCut's files here and in dataset/trackers/.
#pragma once

#include <string>
#include <vector>

#include "core/csv.h"
#include "dataset/arrays/pandas_table.h"

/// DeepLabCut's header rows: scorer, (individuals,) bodyparts, coords (docs/HelperFunctions.md and docs/convert_maDLC.md of
/// its project).
namespace mvstudio::dataset::internal {

/// What a column of numbers holds.
struct DeepLabCutColumn {
  std::string individual;  ///< empty: the file names none
  std::string joint, coord;
};

struct DeepLabCutHeader {
  std::vector<DeepLabCutColumn> columns;  ///< behind the index
  size_t num_index = 1;                   ///< columns before them: the frame, or three parts of an image's path
  size_t width = 0;
};

/// Reads the header rows of a CSV. Throws FormatError with the line.
DeepLabCutHeader ReadDeepLabCutHeader(CsvReader* csv);

/// The columns of the same table in HDF5. Throws FormatError for other numbers of levels.
std::vector<DeepLabCutColumn> DeepLabCutColumns(const ForeignHdf5& file, const PandasTable& table);

/// A number of the index. Throws FormatError for what is no frame.
int DeepLabCutFrame(double index, const ForeignHdf5& file, const std::string& place);

}  // namespace mvstudio::dataset::internal
