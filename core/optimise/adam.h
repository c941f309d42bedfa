#pragma once

#include <cmath>
#include <cstdint>

namespace mvstudio {

/// One step of Adam (Kingma and Ba, "Adam: a method for stochastic optimization", ICLR 2015), beta 0.9 and 0.999.
struct AdamMove {
  float rate = 0;                 ///< step size over the correction of the first moment
  float inverse_correction2 = 1;  ///< 1 over that of the second
  float epsilon = 1e-8f;          ///< in the units of the gradient
};

/// Of step number `step`, from 1, with the step size `rate`.
inline AdamMove AdamMoveOf(double rate, int64_t step, double epsilon) {
  const auto t = static_cast<double>(step);
  return {static_cast<float>(rate / (1 - std::pow(0.9, t))), static_cast<float>(1 / (1 - std::pow(0.999, t))),
          static_cast<float>(epsilon)};
}

/// Ages both moments of a value by its gradient; what to subtract from the value. Inlined always: callers compile their loops
/// for several processors, and none of them with fused multiply-add, so that machines agree to the last bit.
__attribute__((always_inline)) inline float MoveByAdam(float gradient, const AdamMove& move, float* first, float* second) {
  const float m = 0.9f * *first + 0.1f * gradient, v = 0.999f * *second + 0.001f * gradient * gradient;
  *first = m, *second = v;
  return move.rate * m / (std::sqrt(v * move.inverse_correction2) + move.epsilon);
}

}  // namespace mvstudio
