#pragma once

#include <string>

#include "dataset/panoptic/panoptic.h"

namespace mvstudio::dataset {

/// The studio's name of a camera ("cam_02" of 00_01) where the dataset knows it, else the name itself.
inline std::string StudioName(const PanopticDataset& data, const std::string& camera) {
  for (const auto& [alias, panoptic] : data.aliases) {
    if (panoptic == camera) return alias;
  }
  return camera;
}

}  // namespace mvstudio::dataset
