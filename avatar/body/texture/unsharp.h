#pragma once

#include "core/image.h"

namespace mvstudio::body {

/// Unsharp masking inside a mask: clamp(I + amount (I - G * I), 0, 255) where the mask is at least 128; other pixels stay. G is
/// a Gaussian of 2.9 px, cut off at 8 px, in images whose longer edge is 1024 px, and scales with it (Zhao et al.,
/// "High-Fidelity Human Avatars from a Single RGB Camera", CVPR 2022, have these numbers). G * I is a mean over the mask's
/// pixels alone (normalised convolution, Knutsson and Westin, 1993), so no halo arises at the silhouette. `amount` 0 changes
/// nothing. `image` (H, W, 3), `mask` (H, W, 1).
Image SharpenInMask(const Image& image, const Image& mask, double amount);

}  // namespace mvstudio::body
