#pragma once

#include <ATen/core/Tensor.h>

#include <map>
#include <string>

#include "avatar/run/pack/training_set.h"

/// Baselines that an avatar must outperform: images without an avatar.
namespace mvstudio::avatar {

/// For each held-out camera, the training camera with the nearest viewing direction, seen from the middle of the person
/// averaged over the training frames.
std::map<std::string, std::string> NearestTrainingCameras(const dataset::PanopticDataset& data, const DatasetSplit& split,
                                                          int person);

/// Baseline images for a truth of N images.
struct BaselineImages {
  at::Tensor images;  ///< (N, 3, H, W) float64 in [0, 1], on black
  at::Tensor masks;   ///< (N, H, W) float64 in [0, 1]
};

struct Baselines {
  BaselineImages mean_image;    ///< mean of the nearest training camera's crops on black; its mask is the mean of the masks
  BaselineImages nearest_pose;  ///< that camera's training image with the nearest joints, seen from the crop's camera and
                                ///< relative to the middle of the body (mean squared distance over joints known in both)
  std::map<std::string, std::string> nearest_camera;
};

/// `crop` gives size and extent; reads only training cameras and training frames, those images that exist. Throws
/// FormatError when there are none.
Baselines MakeBaselines(const dataset::PanopticDataset& data, const DatasetSplit& split, const TrainingSetOptions& crop,
                        const AvatarPack& truth, const RunContext& run);

/// Mean squared distance (m^2) between two poses (19, 3), each relative to its body centre (the mean of the joints known in
/// both where that is missing); infinity when no joint is known in both.
double PoseDistance(const at::Tensor& joints_a, const at::Tensor& valid_a, const at::Tensor& joints_b,
                    const at::Tensor& valid_b);

/// The crops with everything but the person black: (N, 3, H, W) float64 in [0, 1].
at::Tensor OnBlack(const AvatarPack& pack);

}  // namespace mvstudio::avatar
