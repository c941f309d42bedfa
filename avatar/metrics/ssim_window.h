#pragma once

#include <array>

/// The numbers of SSIM, for its scores and for losses that use it.
namespace mvstudio::metrics {

/// K1 = 0.01 and K2 = 0.03, squared, of samples with range 1: Wang et al., TIP 2004.
inline constexpr double kSsimC1 = 0.01 * 0.01, kSsimC2 = 0.03 * 0.03;

inline constexpr int kWangSide = 11;
/// Weights of Wang's window along one axis: Gaussian, sigma 1.5, sum 1, the same from both ends.
std::array<double, kWangSide> WangWeights();

}  // namespace mvstudio::metrics
