#pragma once

#include <map>
#include <string>
#include <vector>

#include "avatar/body/body_template.h"
#include "avatar/splats/cloud.h"

/// The file of a run: docs/formats.md. Files are written by WriteFileAtomic; reading throws IoError, or FormatError with the
/// place.
namespace mvstudio::splats {

/// What a run keeps: `gaussians.npz`.
struct CloudFile {
  Cloud cloud;
  bool mip = true;  ///< RenderSettings::mip
  int size_px = 0;  ///< edge of the images that it was trained on
  int64_t step = 0;
  uint64_t seed = 0;
  double train_s = 0;  ///< seconds of the training
  /// What was asked of the training, by name, e.g. {"train.steps", "1500"}; empty in files of older versions.
  std::map<std::string, std::string> options;
};
inline constexpr char kCloudFileName[] = "gaussians.npz";
inline constexpr char kCloudSchema[] = "mvstudio.gaussians/1";

/// With the skin of each Gaussian for other programs: bones and weights. What is read is bit for bit what was written. Reading
/// checks lengths, that faces exist in the body, and that numbers are finite.
void WriteCloud(const CloudFile& file, const body::BodyTemplate& body, const std::string& path);
CloudFile ReadCloud(const std::string& path, int num_faces);
std::string CloudFileBytes(const CloudFile& file, const body::BodyTemplate& body);
CloudFile ParseCloud(const std::string& bytes, const std::string& path, int num_faces);

}  // namespace mvstudio::splats
