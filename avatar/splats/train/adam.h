#pragma once

#include <cstdint>

#include "avatar/splats/cloud.h"

namespace mvstudio::splats {

/// Steps of Adam (Kingma and Ba, ICLR 2015), in the units of the parameters.
struct AdamRates {
  double place = 0.01;   ///< barycentric
  double offset = 2e-4;  ///< metres
  double log_scale = 0.01;
  double rotation = 0.005;
  double opacity = 0.03;
  double colour = 0.01;  ///< coefficients of degree 0; higher degrees a tenth
  double bend = 0.005;   ///< in the units of bend.h
};

struct AdamState {
  Parameters<float> first, second;  ///< moments
  int64_t step = 0;
};
AdamState MakeAdam(size_t n, int degree, bool bends = false);

/// One step down the gradient; `share` scales all rates. What is not finite in the gradient counts as 0.
void AdamStep(const Parameters<float>& gradient, const AdamRates& rates, double share, AdamState* state,
              Parameters<float>* values);

}  // namespace mvstudio::splats
