#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/format.h"
#include "dataset/markers/filter.h"

namespace mvstudio::markers {
namespace {

/// Biquad with a0 = 1, direct form II transposed.
struct Biquad {
  double b0, b1, b2, a1, a2;
};

/// Bilinear transform of 1 / (s² + √2 s + 1) with the cut-off where it belongs.
Biquad LowPass(double cutoff_hz, double rate_hz) {
  const double k = std::tan(M_PI * cutoff_hz / rate_hz), norm = 1 / (1 + M_SQRT2 * k + k * k);
  return {k * k * norm, 2 * k * k * norm, k * k * norm, 2 * (k * k - 1) * norm, (1 - M_SQRT2 * k + k * k) * norm};
}

/// In place; the state at the beginning is that of a constant input of the first value.
void Run(const Biquad& f, std::vector<double>* values) {
  double z1 = (1 - f.b0) * values->front(), z2 = (f.b2 - f.a2) * values->front();
  for (double& value : *values) {
    const double out = f.b0 * value + z1;
    z1 = f.b1 * value - f.a1 * out + z2;
    z2 = f.b2 * value - f.a2 * out;
    value = out;
  }
}

}  // namespace

std::vector<double> Butterworth(const std::vector<double>& values, double cutoff_hz, double rate_hz) {
  static const double kTwoPasses = std::pow(M_SQRT2 - 1, 0.25);
  if (!(cutoff_hz > 0) || !(cutoff_hz / kTwoPasses < rate_hz / 2)) {
    throw UsageError(Format("a cut-off of %g Hz needs more than %.4g frames a second; the take has %g", cutoff_hz,
                            2 * cutoff_hz / kTwoPasses, rate_hz));
  }
  if (values.size() < 2) return values;
  // As far as the filter's answer to an impulse lasts.
  const size_t reach = std::min(values.size() - 1, static_cast<size_t>(std::ceil(2 * rate_hz / cutoff_hz)));
  std::vector<double> padded;
  for (size_t i = reach; i > 0; --i) padded.push_back(2 * values.front() - values[i]);
  padded.insert(padded.end(), values.begin(), values.end());
  for (size_t i = 1; i <= reach; ++i) padded.push_back(2 * values.back() - values[values.size() - 1 - i]);
  const Biquad filter = LowPass(cutoff_hz / kTwoPasses, rate_hz);
  for (int pass = 0; pass < 2; ++pass) {
    Run(filter, &padded);
    std::reverse(padded.begin(), padded.end());
  }
  return {padded.begin() + static_cast<std::ptrdiff_t>(reach), padded.end() - static_cast<std::ptrdiff_t>(reach)};
}

}  // namespace mvstudio::markers
