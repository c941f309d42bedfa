#pragma once

#include <initializer_list>
#include <set>

#include "dataset/json/json_internal.h"
#include "dataset/panoptic/panoptic_files.h"

namespace mvstudio::dataset::internal {

/// Size limits far above any file of the format; larger files are refused before reading.
constexpr int64_t kMaxCalibrationBytes = int64_t{16} << 20, kMaxSceneBytes = int64_t{4} << 20,
                  kMaxLandmarkBytes = int64_t{16} << 20, kMaxSyncBytes = int64_t{64} << 20;

/// One entry of "cameras", unchanged. Throws FormatError.
PanopticCamera ReadPanopticCameraFields(const JsonView& json);

/// The same camera in our world. `where` is its place in the file; `drift` receives the distance of R from the nearest
/// rotation.
geometry::RigCamera ToRigCamera(const PanopticCamera& camera, const std::string& path, const std::string& where, double* drift);

/// Checks that a value is an object before its keys are read.
void RequireObject(const JsonView& view);
std::optional<double> OptionalNumber(const JsonView& object, const char* key);
std::optional<std::string> OptionalText(const JsonView& object, const char* key);

/// All keys of an object but those known.
PanopticExtras ExtrasOf(const JsonView& object, std::initializer_list<const char*> known);
/// `,\n"key": value` for each.
std::string ExtrasText(const PanopticExtras& extras, const std::string& indent = "");
/// Numbers separated by `separator`, in the format of a C++ stream.
std::string NumbersText(const std::vector<double>& numbers, const char* separator = ", ");
/// A text in JSON.
std::string JsonText(const std::string& text);

/// Converts a point from Panoptic's world (cm, y down) to ours (m, z up).
Eigen::Vector3d OursFromPanopticCm(double x, double y, double z);
/// The shortest decimal of centimetres that gives exactly `metres` when divided by 100: files survive a round trip
/// unchanged.
double Centimetres(double metres);

}  // namespace mvstudio::dataset::internal
