// Private: for opencv.cc and formats.cc.
#pragma once

#include <string>
#include <string_view>

#include "calib/formats/formats.h"
#include "calib/formats/opencv_yaml.h"

/// Results of MC-Calib, multical and MATLAB: OpenCV's lenses, a table for each camera.
namespace mvstudio::calib::internal {

/// MC-Calib's calibrated_cameras_data.yml: `camera_0` with `camera_pose_matrix`, world from camera.
bool IsMcCalib(const Entries& entries);
/// The world is the reference camera. Throws FormatError for cameras of several groups, which nothing places against each
/// other.
ImportedRig ReadMcCalib(const std::string& path, const Entries& entries, const ReadOptions& options);

/// multical's calibration.json (`cameras` and `camera_poses`, camera from rig).
bool IsMultical(std::string_view json);
ImportedRig ReadMultical(const std::string& path, const ReadOptions& options);

/// jsonencode of MATLAB's stereoParameters or cameraParameters (`toStruct`): pixels from 1, sizes rows first, and rows as
/// vectors.
bool IsMatlab(std::string_view json);
ImportedRig ReadMatlab(const std::string& path, const ReadOptions& options);

/// Whether JSON is Human3.6M's `camera-parameters.json`: `intrinsics` by camera, `extrinsics` by subject and camera.
bool IsHuman36m(std::string_view json);
/// Its cameras; R and t are camera from world, lengths are millimetres. Throws FormatError for several subjects: each is a rig.
ImportedRig ReadHuman36m(const std::string& path, const ReadOptions& options);

/// Whether JSON is InterHand2.6M's camera file: `campos`, `camrot`, `focal`, `princpt` by capture and camera.
bool IsInterHand(std::string_view json);
/// Its cameras: x_in_cam = camrot (x_in_world - campos), millimetres. Throws FormatError for several captures.
ImportedRig ReadInterHand(const std::string& path, const ReadOptions& options);

}  // namespace mvstudio::calib::internal
