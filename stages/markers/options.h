#pragma once

#include <string>

#include "stages/people/marker_export.h"
#include "stages/people/points_input.h"

/// 3D points as files of markers, angles and events, and in other formats: what a caller gives.
namespace mvstudio::stages {

struct MarkersOptions {
  PointsArguments points;
  std::string out;         ///< folder
  bool overwrite = false;  ///< replace it
  MarkerOptions how;       ///< events: without `to`
};

struct MarkerConvertOptions {
  PointsArguments points;
  std::string out;  ///< a file where it ends as the format's names do, else a folder
  bool overwrite = false;
  ConvertOptions how;
};

}  // namespace mvstudio::stages
