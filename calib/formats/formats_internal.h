#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "calib/formats/formats.h"
#include "geometry/lens/camera.h"
#include "geometry/rigid/rigid3.h"

/// Shared by the readers and writers of formats.h; included by their .cc files only.
namespace mvstudio::calib::internal {

/// Where a value was read, for FormatError.
struct Place {
  std::string path, where;
};

/// A camera from a 3x3 matrix and a distortion vector in OpenCV's order; all-zero distortion becomes a pinhole. Throws
/// FormatError for skew, a matrix that is not a camera matrix, a size out of range, or a number of coefficients that no
/// lens model has.
geometry::Camera MakeCamera(const std::string& name, double width_px, double height_px, const Eigen::Matrix3d& k,
                            const Eigen::VectorXd& distortion, bool fisheye, const Place& place);

/// [[fx, 0, cx], [0, fy, cy], [0, 0, 1]].
Eigen::Matrix3d CameraMatrix(double fx, double fy, double cx, double cy);

/// The camera with its size; throws FormatError when the size is out of range or the lens is invalid.
geometry::Camera Checked(geometry::Camera camera, double width_px, double height_px, const Place& place);

/// Same, for a camera made from these values.
geometry::Camera MakeModelCamera(const std::string& name, double width_px, double height_px, geometry::LensModel model,
                                 const Eigen::VectorXd& params, const Place& place);

/// A lens in the form of OpenCV's functions.
struct OpenCvLens {
  Eigen::VectorXd distortion;  ///< 0, 4, 5, 8 or 12 coefficients in OpenCV's order; 4 when fisheye
  bool fisheye = false;
};
/// Empty when OpenCV has no such lens.
std::optional<OpenCvLens> ToOpenCvLens(const geometry::Camera& camera);

/// Same, for a camera that is known to be supported (RigForFormat).
OpenCvLens OpenCvLensOf(const geometry::Camera& camera);

/// Rotation from a file's matrix; throws FormatError when it is farther than 1e-3 from a rotation.
Eigen::Quaterniond MakeRotation(const Eigen::Matrix3d& matrix, const Place& place);

/// At most 40 characters of foreign text for a message, with '?' for whatever is not printable ASCII.
std::string Printable(std::string_view text);

/// Parses all of `text` as a number; throws FormatError otherwise.
double ParseNumber(std::string_view text, const Place& place);

/// Shortest text that parses to the same number, with a '.' or an exponent.
std::string NumberText(double value);
/// `[1.0, 2.0]`.
std::string ListText(const Eigen::VectorXd& vector);
/// `"text"` with backslash escapes for JSON, TOML and YAML. Throws UsageError for control characters.
std::string Quoted(const std::string& text);

/// Adds a camera; throws FormatError when its name is empty, not UTF-8, or already present.
void AddCamera(geometry::RigCamera camera, const Place& place, geometry::Rig* rig);

/// Returns `name` if it is a valid file name; throws UsageError otherwise.
const std::string& FileName(const std::string& name);

/// Without folders and extension.
std::string Stem(const std::string& path);

/// Note for files that name no unit.
ImportNote UnitNote(double metres_per_unit);

// Writers: every lens is supported and translations are in metres_per_unit. They return the files they wrote.
using Files = std::vector<std::string>;
Files WriteToml(const geometry::Rig& rig, const std::string& path, bool nested);
Files WriteQca(const geometry::Rig& rig, const std::string& path, double distortion_divisor);
/// Note about the divisor, see ReadQca; empty where no lens has distortion.
std::optional<ImportNote> QcaDivisorNote(const geometry::Rig& rig, double divisor, bool writing);
Files WriteOpenCvYaml(const geometry::Rig& rig, const std::string& path);
Files WriteEasyMocap(const geometry::Rig& rig, const std::string& path);
Files WriteMrcal(const geometry::Rig& rig, const std::string& path);
Files WriteColmap(const geometry::Rig& rig, const std::string& path, bool text);
Files WriteNerfstudio(const geometry::Rig& rig, const std::string& path);
Files WriteKalibr(const geometry::Rig& rig, const std::string& path);

// Whether the format supports this lens.
bool ColmapCanCarry(const geometry::Camera& camera);
bool MrcalCanCarry(const geometry::Camera& camera);
bool NerfstudioCanCarry(const geometry::Camera& camera);
bool KalibrCanCarry(const geometry::Camera& camera);

}  // namespace mvstudio::calib::internal
