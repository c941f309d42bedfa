#pragma once

#include <string>

#include "dataset/pose/pose3d.h"
#include "stages/input_notes.h"

/// 3D joints as the commands on markers take them: of a run or of a file.
namespace mvstudio::stages {

struct PointsArguments {
  std::string path;      ///< a folder of triangulate, its points.csv or pose3d.json, or a file of markers
  std::string skeleton;  ///< name or file; empty: what the points state
  std::string unit, up;  ///< of a file of markers, instead of what it says; may be empty
  std::string frames;    ///< "80-99" or "1,4,7-9"; empty: all
  double rate_hz = 0;    ///< frames a second; 0: as the points state it
};

/// Without the points.
template <class Visitor>
void VisitFields(Visitor&& visit, PointsArguments& o) {
  visit("unit,marker-unit", o.unit,
        "m, cm, mm, in or the length of one unit, e.g. 25mm: of such a file, instead of what it states");
  visit("up", o.up, "x, y or z: the axis that is up in such a file, instead of what it states");
  visit("frames", o.frames, "80-99 or 1,4,7-9; all unless given");
  visit("skeleton", o.skeleton,
        "bones of the joints, where the input does not state them: a name that triangulate knows, or a file FILE.toml "
        "(docs/formats.md)");
}

struct PointsInput {
  dataset::Pose3d pose;  ///< frame_rate_hz is positive
  std::string unit, up;  ///< of the file; empty for points of mvstudio
  bool is_run = false;   ///< points of mvstudio
};

/// Reads the points; what a file says against itself and a unit that makes nobody's size become warnings (MRK-FILE, MRK-UNIT).
/// Positions of files that mark none as filled count as measured. Throws UsageError where nothing states the frame rate, and
/// for frames that are not there; errors of dataset::ReadPoints3d.
PointsInput ReadPointsInput(const PointsArguments& arguments, InputNotes* notes);

}  // namespace mvstudio::stages
