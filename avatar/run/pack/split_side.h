#pragma once

#include <string>
#include <vector>

#include "avatar/run/pack/training_set.h"
#include "dataset/panoptic/missing.h"

/// The images of one side of a split, and whether enough of them exist.
namespace mvstudio::avatar {

/// Cameras x frames.
struct SplitSide {
  std::string kind;  ///< "training cameras in training frames", "held-out cameras in held-out frames", …
  std::vector<std::string> cameras;
  std::vector<int> frames;
};

SplitSide TrainingSide(const DatasetSplit& split);
/// What is scored: held-out cameras in held-out frames or, if only one of the two was held out, that one with the
/// training's other; without cameras when nothing was.
SplitSide HoldoutSide(const DatasetSplit& split);

/// More of a training side may not be missing.
inline constexpr double kMostMissing = 0.5;

/// The images of the side that are missing. Throws FormatError when none is left, when a camera has none, and when more
/// than the share `most` of them are missing.
dataset::MissingImages RequireImages(const dataset::PanopticDataset& data, const SplitSide& side, double most = 1);

/// The side's frames in which a camera of it has an image, so that a choice among them finds some.
std::vector<int> FramesWithImages(const dataset::PanopticDataset& data, const SplitSide& side);

/// Scores `names` (commas between them; none: nothing changes) in place of the cameras that were held out. Throws UsageError
/// for cameras that the dataset lacks or that were trained on.
void UseCameras(const dataset::PanopticDataset& data, const std::string& names, DatasetSplit* split);

/// Images of training cameras pose held-out frames, so they cannot be scored there.
bool ShowsItsPoses(const DatasetSplit& split, const SplitSide& selection);

}  // namespace mvstudio::avatar
