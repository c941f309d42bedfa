#pragma once

#include <string>
#include <string_view>

#include "markers/marker_take.h"

/// Contents of marker files.
namespace mvstudio::markers {

/// Unit of the lengths in a .trc file, which its header states.
enum class TrcUnit { kMillimetre, kMetre };
std::string_view ToString(TrcUnit unit);  ///< "mm", "m"
/// Throws UsageError.
void FromString(const std::string& text, TrcUnit* unit);

/// TRC (OpenSim): tabs, y up: the file's (x, y, z) are the world's (y, z, x), z up. Frames count from 1; time
/// begins at 0. Missing positions are empty. `file_name` is stated in the first line.
std::string TrcText(const MarkerTake& take, const std::string& file_name, TrcUnit unit = TrcUnit::kMillimetre);

/// C3D: floats, millimetres, the world's own axes. The residual is a position's deviation (mm), 0 where it was filled or where
/// the deviation is not known, -1 where it is missing. Throws UsageError for more than 255 markers.
std::string C3dBytes(const MarkerTake& take);

/// frame,time_s,joint,x_m,y_m,z_m,sigma_m,source with the source measured or filled; missing positions have no line.
std::string CsvText(const MarkerTake& take);

}  // namespace mvstudio::markers
