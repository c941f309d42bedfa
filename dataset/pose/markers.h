#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "dataset/pose/pose3d.h"

namespace mvstudio::dataset {

/// A file of 3D markers, read as points.
struct MarkerFile {
  Pose3d pose;       ///< skeleton "points"; rows kOk, or kTooFewViews where the file has no point; no views, no sigma
  std::string unit;  ///< of the file's lengths: m, cm, mm or in
  bool y_up = true;  ///< the file's y axis is up: x_in_world = (z, x, y) of the file; else its axes are kept (z up)
  std::vector<std::string> notes = {};  ///< what the file states about itself and does not hold, in sentences
};

/// "m", "mm", "millimeters", "inches", …; metres, or nothing for another word.
std::optional<double> MetresPerUnit(std::string_view word);

/// True for a file called *.trc or *.c3d.
bool IsMarkerFile(const std::string& path);

/// Reads a .trc or .c3d file. `unit` replaces what the file says; empty: the file's own. Throws UsageError for an unknown
/// unit; IoError; FormatError with the place, also for a file that states no unit.
MarkerFile ReadMarkers(const std::string& path, const std::string& unit = {});

/// What speaks against the unit, in a sentence: in most frames the points of a file lie within 5 mm, or over more than 20 m.
/// Empty where nothing does, and where no frame has two points.
std::string UnitDoubt(const MarkerFile& file, const std::string& path);

/// The notes of a file with its path before them.
std::vector<std::string> NotesOf(const MarkerFile& file, const std::string& path);

/// 3D points of any kind: a folder with points.csv, or a file of markers. Errors as in ReadPose3d and ReadMarkers.
Pose3d ReadPoints3d(const std::string& path, const std::string& unit = {});

}  // namespace mvstudio::dataset
