#pragma once

#include <vector>

#include "avatar/splats/raster.h"

namespace mvstudio::splats {

/// Adds to `out` (as many as the cloud) what the loss changes by each parameter, from the gradients of its splats in one image:
/// the chain from the projection to the parameters, all of it exact but for clamped values, which have none. `view_space` (N),
/// if given, gets the length of the derivative by the splat's place in the image, per px: Kerbl et al., 2023, section 5.2.
template <class S>
void AddGradients(const BasicCloud<S>& cloud, const Surface<S>& surface, const PinholeView<S>& view,
                  const RenderSettings& settings, const std::vector<Splat<S>>& splats,
                  const std::vector<SplatGradient<S>>& gradients, Parameters<S>* out, std::vector<S>* view_space = nullptr);

extern template void AddGradients(const BasicCloud<float>&, const Surface<float>&, const PinholeView<float>&,
                                  const RenderSettings&, const std::vector<Splat<float>>&,
                                  const std::vector<SplatGradient<float>>&, Parameters<float>*, std::vector<float>*);
extern template void AddGradients(const BasicCloud<double>&, const Surface<double>&, const PinholeView<double>&,
                                  const RenderSettings&, const std::vector<Splat<double>>&,
                                  const std::vector<SplatGradient<double>>&, Parameters<double>*, std::vector<double>*);

}  // namespace mvstudio::splats
