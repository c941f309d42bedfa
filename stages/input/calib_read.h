#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/formats/formats.h"
#include "calib/formats/length_unit.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// "WIDTHxHEIGHT"; 0x0: not stated. As an option, see core/fields.h.
struct ImageSize {
  int width_px = 0, height_px = 0;
};
std::string ToString(const ImageSize& size);
void FromString(const std::string& text, ImageSize* size);

/// Options of the `calib` commands for reading calibrations.
struct CalibReadOptions {
  std::optional<calib::CalibrationFormat> from;  ///< none: by the file's content
  ImageSize size;                                ///< where the file does not give it
  calib::LengthUnit unit = calib::LengthUnit::kMetre;
  double qca_distortion_divisor = 1;
  geometry::LensKind lens = geometry::LensKind::kUnsaid;  ///< where the file does not say it
  bool invert = false;                                    ///< the file's poses go the other way (geometry/rig/meeting.h)
  bool mirror = false;                                    ///< the file is left-handed
  double allow_approximation_px = 0;                      ///< see calib::ReadOptions
  double frame_rate_hz = 0;                               ///< the same
};

/// Reads a calibration of any format from one or several files, or from a folder that holds one (calib::CalibrationIn);
/// implausible properties (geometry/rig/plausible.h) are among its notes. Throws UsageError, IoError, FormatError.
calib::ImportedRig ReadCalibrationFiles(const std::vector<std::string>& paths, const CalibReadOptions& options);

/// Turns notes into warnings.
void AddNotes(const std::vector<Notice>& more, InputNotes* notes);

/// Same for a calibration that was read without notes: implausible properties become warnings.
void AddImplausible(const geometry::Rig& rig, InputNotes* notes);

/// "auto" and the names of calib::CalibrationFormat one by one, with their aliases.
std::vector<std::string> CalibrationFormatChoices();

/// Field of view of the image, degrees: horizontal, vertical and diagonal; NaN where the lens has no ray.
Eigen::Vector3d FieldOfViewDeg(const geometry::Camera& camera);

/// Standard deviations from the covariances; NaN where the file has none.
struct CameraSigmas {
  double focal_px, rotation_rad, position_m;  ///< the largest over fx, fy; about and along any axis
};
CameraSigmas SigmasOf(const geometry::RigCamera& camera);

/// metrics.num_cameras and cameras[].
CommandResult DescribeCameras(const geometry::Rig& rig);

/// Throws FormatError for lenses only (geometry::HasLensesOnly): the command needs to know where the cameras stand.
void RequirePoses(const geometry::Rig& rig, const std::string& path);

}  // namespace mvstudio::stages
