#pragma once

#include <string>
#include <vector>

#include "app/result.h"
#include "calib/formats/formats.h"

namespace mvstudio::app {

/// How the commands of `calib` read calibrations.
struct CalibReadOptions {
  std::string from = "auto", size, unit = "m";
  double qca_distortion_divisor = 1;
};

/// A calibration of any format in one or several files; what is doubtful of it (geometry/rig/plausible.h) stands among its
/// notes. Throws UsageError, IoError, FormatError.
calib::ImportedRig ReadCalibrationFiles(const std::vector<std::string>& paths, const CalibReadOptions& options);

/// Notes become warnings.
void AddNotes(const std::vector<calib::ImportNote>& notes, CommandResult* result);

/// The same of a calibration that was read without notes: what is doubtful becomes warnings.
void AddDoubts(const geometry::Rig& rig, CommandResult* result);

/// Metres per m, cm or mm.
double MetresPerUnit(const std::string& unit);

/// "mvstudio, panoptic, …".
std::string CalibrationFormatNames();
/// The same one by one, with the other names that a format goes by; `with_auto` adds "auto".
std::vector<std::string> CalibrationFormatChoices(bool with_auto);

/// Angles that the image spans, degrees: across, down and corner to corner; NaN where the lens has no ray.
Eigen::Vector3d FieldOfViewDeg(const geometry::Camera& camera);

/// Standard deviations from the covariances; NaN where the file has none.
struct CameraSigmas {
  double focal_px, rotation_rad, position_m;  ///< the largest over fx, fy; about and along any axis
};
CameraSigmas SigmasOf(const geometry::RigCamera& camera);

/// num_cameras and cameras[].
void AddCameraMetrics(const geometry::Rig& rig, CommandResult* result);

}  // namespace mvstudio::app
