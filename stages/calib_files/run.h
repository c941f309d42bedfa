#pragma once

#include <string>
#include <utility>
#include <vector>

#include "geometry/rig/rig.h"
#include "stages/calib_files/options.h"
#include "stages/input_notes.h"

namespace mvstudio::stages {

struct CalibShowReport {
  InputNotes notes;
  geometry::Rig rig;
};

/// Throws UsageError, IoError and FormatError, as the others here.
CalibShowReport RunCalibShow(const CalibShowOptions& options);

struct CalibConvertReport {
  CalibConvertOptions options;  ///< with `out` as it was written
  InputNotes notes;
  geometry::Rig rig;                                         ///< as it was written
  std::string format;                                        ///< one name of each
  std::string folder;                                        ///< of what was written
  std::vector<std::string> files;                            ///< written
  std::vector<std::pair<std::string, std::string>> renamed;  ///< by the format: earlier name, name in it
  bool renumbered = false;                                   ///< `renamed` is a numbering in the cameras' order
};

/// Writes a calibration of any known program for another.
CalibConvertReport RunCalibConvert(const CalibConvertOptions& options);

struct ResizedCamera {
  geometry::Camera before, after;
};

struct CalibResizeReport {
  InputNotes notes;
  std::string out;
  std::vector<ResizedCamera> cameras;  ///< whose images change
};

/// Writes a calibration for images of another resolution, or for a crop of the calibrated images.
CalibResizeReport RunCalibResize(const CalibResizeOptions& options);

struct LensAddReport {
  InputNotes notes;
  std::string library;
  geometry::Rig lenses;      ///< all of the library
  geometry::RigCamera lens;  ///< that was added
};

/// Adds the lens of a calibrated camera to a library, which is made if need be.
LensAddReport RunLensAdd(const LensAddOptions& options);

struct LensListReport {
  std::string library;
  geometry::Rig lenses;
  bool check = false;  ///< lenses that are implausible or state no covariance are to be named
};

LensListReport RunLensList(const std::string& library, bool check);

}  // namespace mvstudio::stages
