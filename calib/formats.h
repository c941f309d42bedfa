#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/rig.h"

/// Calibrations written by others. Every reader gives metres, `cam_from_world`, pixel (0, 0) at the centre of the top-left
/// pixel, and throws IoError or FormatError with the place. (CMU Panoptic's JSON lives in dataset/panoptic.h.)
namespace mvstudio::calib {

enum class CalibrationFormat { kMvstudio, kPanoptic, kQualisysToml, kQca, kOpenCvYaml };

/// "mvstudio", "panoptic", "qualisys", "qca", "opencv".
std::string_view ToString(CalibrationFormat format);
std::optional<CalibrationFormat> CalibrationFormatFromString(std::string_view name);

/// Looks at the content, then at the name. Throws FormatError when the file is none of ours.
CalibrationFormat DetectFormat(const std::string& path);

/// What a reader had to assume, for the user to check.
struct ImportNote {
  std::string code, text, hint;
};

struct ImportedRig {
  geometry::Rig rig;
  std::vector<ImportNote> notes;
};

/// Calibration TOML of Pose2Sim, Caliscope and Anipose: a table per camera (at the top or under [cameras]) with `size`,
/// `matrix`, `distortions` (OpenCV's order: 4, 5 or 8; 4 of kannala4 when `fisheye`), `rotation` (world to camera: a Rodrigues
/// vector or a 3x3 matrix) and `translation` (metres). Parsed by toml++. Cameras keep the file's order; those with `ignore =
/// true` are left out.
ImportedRig ReadQualisysToml(const std::string& path);

/// Qualisys QCA/QTM calibration (XML), read by a scanner of its own that knows tags and attributes and refuses DTDs.
/// Conventions, found by comparing files with the TOML made from them: positions are the camera centre in world, mm; with
/// M = (r11 r12 r13; r21 …), R_cam_from_world = diag(1, -1, -1) M (the file's camera looks along -z, y up); focal lengths and
/// centres are in 1/64 px, the centre counted from the sensor's corner, hence minus `left` and `top` of fov_video.
struct QcaOptions {
  /// The distortion is divided by this. 64 gives what Pose2Sim makes of the file, so that its TOML and the QCA agree. 1 takes
  /// the coefficients as OpenCV's, dimensionless; chessboard images of one studio speak for 1 (k1 = -0.051 +- 0.012 measured,
  /// -0.047 in the QCA, -0.0007 in the TOML). A note says so whenever the divisor is not 1 and the lens has distortion.
  double distortion_divisor = 64;
};
ImportedRig ReadQca(const std::string& path, const QcaOptions& options = {});

struct OpenCvOptions {
  int width_px = 0, height_px = 0;  ///< taken when the file does not say (image_width, image_height)
  double metres_per_unit = 1;       ///< OpenCV files name no unit: that of T is the unit of the board's squares
};

/// OpenCV FileStorage YAML 1.0, read by a scanner of its own: `camera_matrix` + `distortion_coefficients` (one camera,
/// "camera") or M1, D1, M2, D2, R, T (stereo: "left", "right"; world = left camera). Several files are read as one (OpenCV's
/// stereo sample writes intrinsics and extrinsics apart). Throws UsageError when the image size is neither in the files nor in
/// the options.
ImportedRig ReadOpenCvYaml(const std::vector<std::string>& paths, const OpenCvOptions& options = {});

}  // namespace mvstudio::calib
