// Private: for the reader of .trc files.
#pragma once

#include <array>
#include <map>
#include <string>
#include <string_view>
#include <vector>

/// What the header of a .trc file states, and where its numbers stand.
namespace mvstudio::dataset::internal {

/// Cells of a line, without blanks around them. They are separated by tabs, else by semicolons, commas or blanks.
std::vector<std::string_view> TrcCells(std::string_view line, char separator);
/// The separator of a line: '\t', ';', ',' or ' '.
char TrcSeparator(std::string_view line);

/// A number with a decimal point or comma; NaN for other texts.
double TrcHeaderNumber(std::string_view text);

struct TrcLayout {
  struct Marker {
    std::string label;              ///< as in the file; "point_N" for one without a name
    std::array<size_t, 3> columns;  ///< of X, Y and Z, counted from the first coordinate
  };
  std::map<std::string, std::string> values;  ///< by the names of the header's second line in small letters
  std::vector<Marker> markers;
  size_t num_lines = 0;            ///< of the header
  std::vector<std::string> notes;  ///< what does not fit, in sentences
};

/// The header is found by its words: the line of `DataRate` … `Units` with the values below, the line `Frame#`, `Time` and
/// the markers' names, the line X1, Y1, Z1, …, which may be missing. Names belong to the markers in their order where there
/// are as many as markers, however many tabs are between them (as OpenSim reads them); where there are fewer, to the marker
/// above whose X they stand, or in whose place of a regular row. Throws FormatError with the line where the columns of a
/// name cannot be told.
TrcLayout ReadTrcLayout(const std::string& path, std::string_view text);

}  // namespace mvstudio::dataset::internal
