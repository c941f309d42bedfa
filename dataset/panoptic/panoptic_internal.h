#pragma once

#include <initializer_list>
#include <set>

#include "dataset/json/json_internal.h"
#include "dataset/panoptic/panoptic_files.h"

namespace mvstudio::dataset::internal {

/// Sizes that no file of the format comes near: what is larger is refused before it is read.
constexpr int64_t kMaxCalibrationBytes = int64_t{16} << 20, kMaxSceneBytes = int64_t{4} << 20,
                  kMaxLandmarkBytes = int64_t{16} << 20, kMaxSyncBytes = int64_t{64} << 20;

/// One entry of "cameras" as it is. Throws FormatError.
PanopticCamera ReadPanopticCameraFields(const JsonView& json);

/// The same camera in our world; `where` is its place in the file, `drift` receives the distance of R from the nearest
/// rotation.
geometry::RigCamera ToRigCamera(const PanopticCamera& camera, const std::string& path, const std::string& where, double* drift);

/// An object must be one before its keys are asked for.
void RequireObject(const JsonView& view);
std::optional<double> OptionalNumber(const JsonView& object, const char* key);
std::optional<std::string> OptionalText(const JsonView& object, const char* key);

/// All keys of an object but those known.
PanopticExtras ExtrasOf(const JsonView& object, std::initializer_list<const char*> known);
/// `,\n"key": value` for each.
std::string ExtrasText(const PanopticExtras& extras, const std::string& indent = "");
/// Numbers separated by `separator`, each as a C++ stream writes it.
std::string NumbersText(const std::vector<double>& numbers, const char* separator = ", ");
/// A text in JSON.
std::string JsonText(const std::string& text);

/// The two worlds, one point: cm with y down, m with z up.
Eigen::Vector3d OursFromPanopticCm(double x, double y, double z);
/// The shortest decimal of centimetres whose hundredth is exactly `metres`: files survive a round trip unchanged.
double Centimetres(double metres);

}  // namespace mvstudio::dataset::internal
