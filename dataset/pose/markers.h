#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "dataset/pose/pose3d.h"

namespace mvstudio::dataset {

/// A file of 3D markers, read as points.
struct MarkerFile {
  Pose3d pose;          ///< skeleton "points"; rows kOk, or kTooFewViews where the file has no point; no views, no sigma
  std::string unit;     ///< of the file's lengths: m, cm, mm or in
  bool y_up = true;     ///< the file's y axis is up: x_in_world = (z, x, y) of the file; else its axes are kept (z up)
  std::string up = {};  ///< x, y or z as it was asked for; empty: y_up says it
  std::vector<std::string> notes = {};  ///< what the file states about itself and does not hold, in sentences
};

/// "m", "mm", "millimeters", "inches", …, or the length of one unit, "25mm"; metres, or nothing for another word.
std::optional<double> MetresPerUnit(std::string_view word);

/// Reads a .trc, .c3d, .bvh, .csv, .tsv, .sto, .npz, .npy or .h5 file (dataset/pose/marker_formats.h, marker_programs.h).
/// `unit` replaces what the file says; empty: the file's own. `up` (x, y or z) replaces the axis that the format or the file
/// says is up: x_in_world = (y, z, x), (z, x, y) or (x, y, z) of the file. Throws UsageError for an unknown unit, axis or
/// extension; IoError; FormatError with the place, also for a file that states no unit.
MarkerFile ReadMarkers(const std::string& path, const std::string& unit = {}, const std::string& up = {});
/// True for files with the extensions that ReadMarkers knows, and for EasyMocap's folder keypoints3d, which it takes, too.
bool IsPointsFile(const std::string& path);

/// The world's axes, z up, as x_in_world of a position in a file whose axis `up` is up: see ReadMarkers. Throws UsageError.
Eigen::Vector3d WorldFromAxes(const Eigen::Vector3d& x_in_file, const std::string& up);
Eigen::Vector3d AxesFromWorld(const Eigen::Vector3d& x_in_world, const std::string& up);

/// What speaks against the unit, in a sentence: in most frames the points of a file lie within 5 mm, or over more than 20 m.
/// Empty where nothing does, and where no frame has two points.
std::string UnitConflict(const MarkerFile& file, const std::string& path);

/// The notes of a file with its path before them.
std::vector<std::string> NotesOf(const MarkerFile& file, const std::string& path);

/// The file that ReadPoints3d takes positions from: `path` itself, the points.csv of a folder, or of a folder of FreeMoCap or
/// DeepLabCut its 3D joints; empty: the folder has none of these. Throws FormatError where it has several.
std::string PointsFileAt(const std::string& path);

/// 3D points of any kind: a folder with points.csv (or one whose folder pose3d has it), that table, its pose3d.json, a file
/// of markers, or a folder of FreeMoCap or DeepLabCut with such a file. `file`, if wanted, gets what ReadMarkers says of it;
/// its unit stays empty for points of mvstudio. Errors as in ReadPose3d and ReadMarkers.
Pose3d ReadPoints3d(const std::string& path, const std::string& unit = {}, const std::string& up = {},
                    MarkerFile* file = nullptr);

}  // namespace mvstudio::dataset
