#pragma once

#include <optional>
#include <string>

#include "calib/formats/formats.h"

/// The cameras of exports and of the datasets in whose layouts they are, read back.
namespace mvstudio::exports {

struct Layout {
  calib::CalibrationFormat format;
  std::string path;  ///< what to read: of an export in COLMAP's or nerfstudio's form, the folder of the first frame's model
};

/// The layout of a file or folder by its content: an export by its export.json, everything else by the files and keys that the
/// layout asks for. Empty for what is none; calib::DetectFormat knows the calibrations. Throws FormatError for files and
/// exports that hold joints and no cameras.
std::optional<Layout> DetectLayout(const std::string& path);

/// Reads one of calib::kDatasetLayouts from its folder or its file with cameras. Image sizes that the layout lacks come from
/// export.json beside it, the header of a camera's first image, or the options. Throws IoError, FormatError; UsageError where
/// the size is nowhere, and for a unit where the layout has one of its own.
calib::ImportedRig ReadLayout(calib::CalibrationFormat format, const std::string& path, const calib::ReadOptions& options);

}  // namespace mvstudio::exports
