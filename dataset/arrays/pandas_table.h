// Private: for the readers of DeepLabCut's files.
#pragma once

#include <string>
#include <vector>

namespace mvstudio::dataset::internal {

class ForeignHdf5;

/// A table as pandas' HDFStore keeps it, format "table" or "fixed" (pandas/io/pytables.py).
struct PandasTable {
  std::string group;                              ///< of the file
  std::vector<double> index;                      ///< of each row
  std::vector<std::vector<std::string>> columns;  ///< of each one the levels of its name
  std::vector<std::vector<double>> values;        ///< of each column, a number per row
};

/// The one group of the file with an attribute `pandas_type`, or of several `df_with_missing`; empty: there is none. Throws
/// FormatError where none of several is called so.
std::string FindPandasTable(const ForeignHdf5& file);

/// Throws FormatError with the place for other objects of pandas and for what its columns' names do not fit.
PandasTable ReadPandasTable(const ForeignHdf5& file, const std::string& group);

}  // namespace mvstudio::dataset::internal
