// Private: masks that were made elsewhere, for BuildDataset.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/build/build.h"
#include "dataset/footage/mask_files.h"

namespace mvstudio::dataset::internal {

using GivenMasks = FrameMasks;

/// The masks of every camera with footage, numbered by the last number of each name: FOLDER/CAMERA/FRAME.png, the camera's name
/// in any spelling (PlainWord); FOLDER/CAMERA/masks/FRAME.png; FOLDER/CAMERA_FRAME.png; FOLDER/FRAME/CAMERA.png; and of a file
/// for each object FRAME_OBJECT.png, OBJECT/FRAME.png or FRAME/OBJECT.png. Empty without a folder. Throws IoError when the
/// folder is not there or holds masks of none of the cameras, FormatError for two masks of a frame and what MeaningOfMasks
/// throws.
std::map<std::string, GivenMasks> FindGivenMasks(const BuildInputs& inputs);

/// Gives masks the numbers of their frames where those count from 0 and the masks from `first_mask`, or, where that is 0, from
/// 1 for sure (FirstNumber::kOne). A notice says which cameras' were moved, and another which may have to be. Throws
/// FormatError for a mask below `first_mask`.
std::vector<Notice> NumberMasksAsFrames(const BuildInputs& inputs, std::map<std::string, GivenMasks>* given);

}  // namespace mvstudio::dataset::internal
