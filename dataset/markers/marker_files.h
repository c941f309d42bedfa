#pragma once

#include <string>
#include <string_view>

#include "dataset/markers/marker_take.h"

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

/// C3D: floats, millimetres, the world's own axes, or with `up` "x" or "y" those in which that axis is up
/// (dataset::AxesFromWorld). The residual is a position's deviation (mm), 0 where it was filled or where the deviation is not
/// known, -1 where it is missing. Throws UsageError for more than 255 markers.
std::string C3dBytes(const MarkerTake& take, const std::string& up = "z");

/// frame,time_s,joint,x_m,y_m,z_m,sigma_m,source with the source measured or filled; missing positions have no line.
std::string CsvText(const MarkerTake& take);

/// Unit and axes of what has no convention of its own.
struct FileSpace {
  std::string unit = "m";  ///< m, cm, mm or in
  std::string up = "z";    ///< the axis that is up, dataset::AxesFromWorld
};

/// A row per frame: frame,time_s,Nose_x_m,Nose_y_m,Nose_z_m,…; missing positions are empty.
std::string WideCsvText(const MarkerTake& take, const FileSpace& space = {"m", "z"});

/// OpenSim's Storage of Vec3: DataRate, Units, `time` and a column per marker with x,y,z; NaN where missing. Times are those of
/// the frames' own numbers.
std::string StoText(const MarkerTake& take, const FileSpace& space = {"m", "y"});

/// numpy: joints (frames, 1, markers, 3), NaN where missing, joint_names, frames, people, rate_hz, sigma_m (metres, 0: not
/// known), filled, unit.
std::string NpzBytes(const MarkerTake& take, const FileSpace& space = {"m", "z"});

}  // namespace mvstudio::markers
