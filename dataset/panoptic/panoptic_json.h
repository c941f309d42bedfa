// Private: nlohmann's JSON, for the readers and writers of Panoptic's files.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "dataset/json/json_file.h"
#include "dataset/panoptic/panoptic_files.h"

namespace mvstudio::dataset::internal {

/// Size limits far above any file of the format; larger files are refused before reading.
constexpr int64_t kMaxCalibrationBytes = int64_t{16} << 20, kMaxSceneBytes = int64_t{4} << 20,
                  kMaxLandmarkBytes = int64_t{16} << 20, kMaxSyncBytes = int64_t{64} << 20;

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

}  // namespace mvstudio::dataset::internal
