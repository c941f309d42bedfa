// Private: BuildDataset's look at what it wrote.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/build/build_camera.h"

namespace mvstudio::dataset::internal {

/// DAT-EXCHANGED for cameras with each other's footage, in the dataset in `folder`; DAT-MASK for other cameras whose masks few
/// joints support.
void WarnOfFootage(const std::vector<CameraResult>& results, const std::map<int, People>& poses, const std::string& folder,
                   const BuildOptions& options, const RunContext& run, std::vector<Notice>* warnings);

}  // namespace mvstudio::dataset::internal
