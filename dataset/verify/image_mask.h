#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/verify/verify.h"

/// Whether the images, masks and joints of a dataset belong together, on a few frames of each camera.
namespace mvstudio::dataset {

/// Camera (Panoptic name) -> its frames, ascending, that may be looked at.
using CameraFrames = std::map<std::string, std::vector<int>>;

/// Compares images with masks: how strong an image's edges are along the outline of its own mask, of the other cameras'
/// masks of the frame, and of its camera's masks of up to 8 frames before and after. An error DAT-IMAGE-MASK for each camera
/// whose images another of these explains clearly better, in several frames. Files that are missing, damaged or of another
/// size are left out; images without contrast and people who stand still give none.
std::vector<Finding> CompareImagesWithMasks(const PanopticDataset& data, const MaskMeaning& masks, const CameraFrames& frames,
                                            const RunContext& run);

/// An error DAT-EXCHANGED for each two cameras with each other's images (dataset/panoptic/exchanged.h), of those in `frames`.
std::vector<Finding> CompareImagesWithJoints(const PanopticDataset& data, const CameraFrames& frames, const RunContext& run);

/// DAT-COVER for each camera whose joints lie off its masks, as VerifyDataset finds it, in up to 8 frames.
std::vector<Finding> CompareJointsWithMasks(const PanopticDataset& data, const MaskMeaning& masks, const CameraFrames& frames,
                                            const RunContext& run);

}  // namespace mvstudio::dataset
