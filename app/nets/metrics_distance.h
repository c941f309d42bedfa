#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/result.h"
#include "core/progress.h"

/// Distances between sets of images or features for `mvstudio metrics`. Needs libtorch.
namespace mvstudio::app {

struct DistanceResult {
  double fd = 0, floor = 0, kid = 0, kid_se = 0;
  int64_t n_a = 0, n_b = 0, d = 0;
  std::string features;
  std::string name;  ///< "FID" or "FD (features)"
};

/// For two files of features (.npy, or .safetensors with a tensor `features`). Throws IoError, FormatError.
DistanceResult CompareFeatureFiles(const std::string& reference, const std::string& other, const RunContext& run);

/// For two lists of images, by a net: "gabor", "posenet", "auto", or a TorchScript file. The images may have different
/// sizes.
DistanceResult ComparePictureSets(const std::vector<std::string>& reference, const std::vector<std::string>& other,
                                  const std::string& net, const RunContext& run);

}  // namespace mvstudio::app
