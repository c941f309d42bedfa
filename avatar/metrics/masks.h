#pragma once

#include "avatar/metrics/ssim.h"

namespace mvstudio::metrics {

/// Intersection over union; 1 when both are empty. Masks of equal size (else ContractViolation).
double MaskIou(const Mask& a, const Mask& b);

/// Agreement of two outlines: harmonic mean of the fractions of each outline's pixels that lie within `tolerance_px` of
/// the other (Perazzi et al., "A Benchmark Dataset and Evaluation Methodology for Video Object Segmentation", CVPR 2016).
/// Outline: pixels of the mask with a 4-neighbour outside it; the image's border counts as inside. 1 when both have none,
/// 0 when one has.
double BoundaryF(const Mask& truth, const Mask& mask, int width, int height, double tolerance_px);

/// The tolerance of the benchmark above: 0.8 % of the image's diagonal, at least 1 px.
double BoundaryTolerancePx(int width, int height);

/// Squared distance of every pixel to the nearest nonzero one, px^2, infinite when there is none. Felzenszwalb and
/// Huttenlocher, "Distance Transforms of Sampled Functions", 2012.
std::vector<double> SquaredDistances(const Mask& mask, int width, int height);

/// The smallest box around the mask, enlarged by `margin` of its longer side on each side, at least `least` px, inside the
/// image. Empty box for an empty mask.
Box MaskBox(const Mask& mask, int width, int height, double margin, int least);

/// Temporal flicker: mean |(b_t - b_(t-1)) - (a_t - a_(t-1))| / range over the pixels of both masks of the truth and all
/// channels. Measures changes in the render that are not in the truth; 0 for a render that is the truth plus a constant.
Score Flicker(const PlanarImage& truth_before, const PlanarImage& truth, const PlanarImage& image_before,
              const PlanarImage& image, const Mask& mask_before, const Mask& mask);

}  // namespace mvstudio::metrics
