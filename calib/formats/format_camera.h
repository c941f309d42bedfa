// Private: for the readers and writers of calib/.
#pragma once

#include <Eigen/Geometry>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "calib/formats/document.h"
#include "calib/formats/format_text.h"
#include "calib/formats/formats.h"
#include "geometry/lens/camera.h"
#include "geometry/rig/file_keys.h"
#include "geometry/rig/rig.h"

/// Cameras, lenses and poses as several formats have them.
namespace mvstudio::calib::internal {

/// A camera from a 3x3 matrix and a distortion vector in OpenCV's order; all-zero distortion becomes a pinhole. Throws
/// FormatError for skew, a matrix that is not a camera matrix, a size out of range, or a number of coefficients that no
/// lens model has.
geometry::Camera MakeCamera(const std::string& name, double width_px, double height_px, const Eigen::Matrix3d& k,
                            const Eigen::VectorXd& distortion, bool fisheye, const Place& place);

/// Same; a skew goes the way of ReplaceSkew. The pose is that turn or none: multiply it by the file's from the right.
geometry::RigCamera MakeRigCamera(const std::string& name, const Eigen::Vector2d& size_px, const Eigen::Matrix3d& k,
                                  const Eigen::VectorXd& distortion, bool fisheye, const ReadOptions& options,
                                  const Place& place, std::vector<Notice>* notes);

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

/// Rotation from a file's Rodrigues vector; throws FormatError for more than a full turn, as degrees would be.
Eigen::Quaterniond RotationFromVector(const Eigen::Vector3d& vector, const Place& place);

/// Adds a camera; throws FormatError when its name is empty, not UTF-8, or already present.
void AddCamera(geometry::RigCamera camera, const Place& place, geometry::Rig* rig);

/// Note for files that name no unit.
Notice UnitNote(double metres_per_unit);

/// Kalibr's camchains: one, or several whose cameras all name their pose against the same IMU (T_cam_imu), which then is the
/// world; several without any pose hold lenses alone. Throws FormatError where chains are not placed against each other.
ImportedRig ReadKalibrChains(const std::vector<std::string>& paths, const ReadOptions& options);

/// The file holds lenses alone: the gauge, and the note CAL-NOPOSE.
void StateLensesOnly(ImportedRig* imported);

/// An image of a file: its path there, the name it would give its camera, lens and pose.
struct ImageCamera {
  std::string path, name;
  geometry::RigCamera camera;
  Place place;
};

/// The cameras that took the images. Images of one folder, or of one name in several folders, that share pose and lens are
/// one camera: `cam1/000000.jpg`, `cam1/000001.jpg`. Where file names repeat, a camera is named by its folder. Notes say both,
/// and when the images of a folder stand at different places. Throws FormatError for names that are used twice nevertheless.
void AddImageCameras(std::vector<ImageCamera> images, ImportedRig* imported);

// Keys that a reader did not ask for: a ValueView remembers those it was asked for.

/// A number, a text, or JSON-like text of a list or table; empty for null.
std::string TextOf(const Value& value);

/// What the table's keys say about its lens; marks them as read.
void AddLensWords(const ValueView& table, geometry::LensWords* words);
/// The kind that file and option state. Throws FormatError when they differ.
geometry::LensKind LensKindOf(const geometry::LensWords& words, const ReadOptions& options, const Place& place);

/// Adds the keys that nobody read in the table and in the tables and lists that were read; `harmless` names, in lower case
/// letters and digits, those that say nothing about geometry.
void AddUnused(const ValueView& table, std::initializer_list<const char*> harmless, geometry::UnusedKeys* unused);

/// The note on them, if there are any.
void AddUnusedNote(const geometry::UnusedKeys& unused, ImportedRig* imported);

}  // namespace mvstudio::calib::internal
