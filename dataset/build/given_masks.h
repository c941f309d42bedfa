// Private: masks that were made elsewhere, for BuildDataset.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/build/build.h"
#include "dataset/footage/mask_io.h"

namespace mvstudio::dataset::internal {

/// The masks of one camera: number of the footage's frame -> file.
struct GivenMasks {
  std::map<int64_t, std::string> files;
  MaskMeaning meaning;  ///< of all cameras' masks
};

/// FOLDER/CAMERA/*.png of every camera with footage, numbered by the last number of each name; empty without a folder. Throws
/// IoError when the folder is not there or holds masks of none of the cameras, FormatError for two masks of a frame and what
/// MeaningOfMasks throws.
std::map<std::string, GivenMasks> FindGivenMasks(const BuildInputs& inputs);

/// Gives masks the numbers of their frames where those count from 0 and the masks from `first_mask`, or, where that is 0, from
/// 1 for sure (FirstNumber::kOne). A notice says which cameras' were moved, and another which may have to be. Throws
/// FormatError for a mask below `first_mask`.
std::vector<Notice> NumberMasksAsFrames(const BuildInputs& inputs, std::map<std::string, GivenMasks>* given);

/// The mask of a frame; empty where there is none. Throws FormatError for another size.
Image GivenMask(const GivenMasks& masks, int64_t frame, int width, int height);

}  // namespace mvstudio::dataset::internal
