#pragma once

#include <cstdint>
#include <vector>

#include "avatar/splats/cloud.h"
#include "avatar/splats/project.h"
#include "avatar/splats/train/adam.h"
#include "core/random.h"

/// Where Gaussians are missing, where they are of no use, and how fine they may become.
namespace mvstudio::splats {

/// Metres that a pixel covers at each Gaussian (N), in the camera that sees it finest among `views`, each with its own posed
/// vertices; where none does, the coarsest that any Gaussian has.
std::vector<float> PixelSizes(const Cloud& cloud, const Eigen::Matrix3Xi& faces, const std::vector<PinholeView<float>>& views,
                              const std::vector<const Eigen::Matrix3Xf*>& vertices, int num_threads);

/// The 3D smoothing filter of Yu et al., "Mip-Splatting", CVPR 2024, section 5.1: what is finer than half of a pixel was never
/// seen. 0.2 squared pixels, m^2.
void SetFilters(const std::vector<float>& pixel_m, Cloud* cloud);

/// Mean lengths of the derivative by the place in the image.
struct ViewSpaceGradients {
  std::vector<float> sum;  // (N)
  std::vector<int> seen;   // (N) images
};

struct DensityOptions {
  double growth = 0.05;         ///< share of the Gaussians that are divided at a time: those with the largest gradients
  double split_px = 1.0;        ///< those wider than this (standard deviation) are split, others are cloned
  double least_opacity = 0.02;  ///< those below are removed
  int64_t most = 60000;         ///< Gaussians in all
};

struct DensityReport {
  int64_t cloned = 0, split = 0, pruned = 0;
};

/// Kerbl et al., "3D Gaussian Splatting for Real-Time Radiance Field Rendering", TOG 2023, section 5.2, with a share in place
/// of a threshold. A clone and its origin get the opacity that together is the old one (Bulo et al., "Revising Densification in
/// Gaussian Splatting", ECCV 2024). Halves of a split stay on the triangle. `rest` are the body's vertices at rest. Moments and
/// pixel sizes follow; new Gaussians begin without moments.
DensityReport Densify(const DensityOptions& options, const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& rest,
                      const ViewSpaceGradients& gradients, Rng* rng, Cloud* cloud, AdamState* state,
                      std::vector<float>* pixel_m);

/// Keeps the parameters where they mean something: places at most half a triangle outside theirs, offsets within 10 cm,
/// standard deviations from 0.1 mm to 20 cm, opacities below 0.998, coefficients of the
/// corrective of poses within 5, and quaternions of length 1.
void Confine(Cloud* cloud);

}  // namespace mvstudio::splats
