// Private: for loss.cc.
#pragma once

#include <vector>

#include "avatar/metrics/planar_image.h"

namespace mvstudio::splats {

/// Mean SSIM of one plane (H, W) of samples in [0, 1] over the windows inside `box`, Wang et al., TIP 2004: Gaussian 11x11,
/// sigma 1.5. Adds `scale` times its derivative by each sample of `image` to `by_image` (H, W). 0, and no derivative, where
/// the box has no window.
template <class S>
double AddSsimGradient(const S* image, const S* truth, int width, const metrics::Box& box, S scale, S* by_image);

extern template double AddSsimGradient(const float*, const float*, int, const metrics::Box&, float, float*);
extern template double AddSsimGradient(const double*, const double*, int, const metrics::Box&, double, double*);

}  // namespace mvstudio::splats
