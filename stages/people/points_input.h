#pragma once

#include <string>

#include "dataset/pose/pose3d.h"
#include "stages/result.h"

/// 3D joints as the commands on markers take them: of a run or of a file.
namespace mvstudio::stages {

struct PointsArguments {
  std::string path;      ///< a folder of triangulate, its points.csv or pose3d.json, or a file of markers
  std::string skeleton;  ///< name or file; empty: what the points state
  std::string unit, up;  ///< of a file of markers, instead of what it says; may be empty
  std::string frames;    ///< "80-99" or "1,4,7-9"; empty: all
  double rate_hz = 0;    ///< frames a second; 0: as the points state it
};

struct PointsInput {
  dataset::Pose3d pose;  ///< frame_rate_hz is positive
  std::string unit, up;  ///< of the file; empty for points of mvstudio
  bool is_run = false;   ///< points of mvstudio
};

/// Reads the points; what a file says against itself and a unit that makes nobody's size become warnings (MRK-FILE, MRK-UNIT).
/// Positions of files that mark none as filled count as measured. Throws UsageError where nothing states the frame rate, and
/// for frames that are not there; errors of dataset::ReadPoints3d.
PointsInput ReadPointsInput(const PointsArguments& arguments, CommandResult* result);

/// Keeps the frames of `ranges` (option 'frames'); empty: all. Throws what KnownFrames does; says what is beyond the last
/// frame.
void KeepFrames(const std::string& ranges, const std::string& path, dataset::Pose3d* pose, CommandResult* result);

}  // namespace mvstudio::stages
