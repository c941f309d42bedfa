// Private: for the readers of marker files.
#pragma once

#include <string>
#include <vector>

#include "dataset/pose/markers.h"

/// Files of markers beside .trc and .c3d. `unit` as in ReadMarkers; `up` is set to what the format says.
namespace mvstudio::dataset::internal {

/// Biovision: joint centres by forward kinematics; y up, x_in_world = (x, -z, y) of the file; the file names no unit, which is
/// taken as cm.
MarkerFile ReadBvhMarkers(const std::string& path, const std::string& unit);
/// Tables with a row per point (`joint` and x, y, z) or a row per frame (three columns a point: `Nose_x`, `Nose.X`,
/// `Nose_x_mm`).
MarkerFile ReadCsvMarkers(const std::string& path, const std::string& unit);
/// OpenSim's Storage: a table of Vec3, or three columns a point; y up.
MarkerFile ReadStoMarkers(const std::string& path, const std::string& unit);
/// numpy: `joints` (frames, [people,] points, 3), `joint_names`, `frames`, `people`, `rate_hz`; z up.
MarkerFile ReadNpzMarkers(const std::string& path, const std::string& unit);

std::string LowerCase(std::string text);

/// Three columns that are one point.
struct ColumnTriple {
  std::string name;
  int columns[3] = {-1, -1, -1};
  std::string unit = {};  ///< as the columns' names say; empty: they do not
};
/// Those of a header, by order of their first columns. Names end in x, y, z behind `_`, `.`, `:`, `-` or a blank, in any case,
/// perhaps with `t` or `p` before them (OpenSim) and a unit behind them. Throws FormatError for columns with different units.
std::vector<ColumnTriple> FindTriples(const std::vector<std::string>& header, const std::string& path);

/// The unit that was asked for, else that stated; throws FormatError that names the option where there is neither.
std::string UnitOrAsk(const std::string& asked, const std::string& stated, const std::string& path);

/// A point as a row; missing where it is not finite.
void AddMarkerRow(int frame, int person, const std::string& joint, const Eigen::Vector3d& metres_in_world, Pose3d* pose);
/// Throws FormatError where a person's point is twice in a frame.
void SortByFrame(const std::string& path, Pose3d* pose);
/// Frames a second of frames with these times; 0 where they do not say it, and a note where they are not even.
double RateOf(const std::vector<std::pair<int, double>>& times, std::vector<std::string>* notes);

}  // namespace mvstudio::dataset::internal
