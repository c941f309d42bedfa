#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "stages/input/image_file_pairs.h"
#include "stages/scores/run.h"

/// Distances between sets of images or features for `mvstudio metrics`. Needs libtorch.
namespace mvstudio::stages {

/// One of two sets: images, or else a file of features (.npy, .safetensors, .npz) or statistics (.npz).
struct DistanceSide {
  std::string path;                 ///< of the file, or the images' folder
  std::vector<std::string> images;  ///< empty for a file
};

/// True for .npy, .npz and .safetensors.
bool IsFeatureFile(const std::string& path);

/// By a net where a side has images: "gabor", "posenet", "auto", or a TorchScript file. Images may have different sizes and
/// need no partners; those with opacity lie over `backdrop`. Statistics are `mu` (d) and `sigma` (d, d), as pytorch-fid
/// writes them. Throws IoError, FormatError: also for an .npz that holds something else, which it names.
DistanceResult CompareSides(const DistanceSide& reference, const DistanceSide& other, const std::string& net,
                            const Backdrop& backdrop, const RunContext& run);

/// Writes `mu` and `sigma` of a set as .npz, with `features` (the net's name) and `n`.
WrittenStatistics WriteStatistics(const DistanceSide& side, const std::string& net, const Backdrop& backdrop,
                                  const std::string& out, const RunContext& run);

/// RunPairScores with distances between the sets: of pairs that are large enough, and of sets without pairs, whose distance is
/// all that is reported; or the statistics of one set, which are written. Throws UsageError, IoError and FormatError.
ScoresReport RunScores(const ScoresOptions& options, const RunContext& run = {});

}  // namespace mvstudio::stages
