// Private: BuildDataset's look at what it wrote.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/build/build_camera.h"

namespace mvstudio::dataset::internal {

/// DAT-EXCHANGED for cameras with each other's footage, in the dataset in `folder`; of other cameras DAT-MASK where few joints
/// support the masks that were made, DAT-COVER and DAT-IMAGE-MASK (dataset/verify/image_mask.h) of those that were given
/// in the folder `masks` (empty: none were).
void WarnOfFootage(const std::vector<CameraResult>& results, const std::map<int, People>& poses, const std::string& folder,
                   const BuildOptions& options, const std::string& masks, const RunContext& run, std::vector<Notice>* warnings);

}  // namespace mvstudio::dataset::internal
