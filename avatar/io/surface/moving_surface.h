#pragma once

#include "body/dynamic/dynamic_fit.h"

namespace mvstudio::avatar {

/// Offsets that move with the pose, trained and judged on the silhouettes of a fit, and added to the person's pose directions
/// where they are kept.
body::DynamicFit FitMovingSurface(const std::vector<body::FitStep>& steps, const std::vector<body::RejectedView>& rejected,
                                  body::DynamicMode mode, const RunContext& run, body::PersonBody* person);

}  // namespace mvstudio::avatar
