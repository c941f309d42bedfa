#include "core/optimise/adam.h"

#include <limits>

#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

TEST(Adam, AConstantGradientMovesByTheRateInEveryStep) {
  for (const float gradient : {3.f, -1e-4f}) {
    float first = 0, second = 0;
    for (int step = 1; step <= 200; ++step) {
      const float moved = MoveByAdam(gradient, AdamMoveOf(0.01, step, 1e-12), &first, &second);
      EXPECT_NEAR(moved, gradient > 0 ? 0.01 : -0.01, 1e-6) << step;
    }
  }
}

TEST(Adam, IsTheFormulaInDouble) {
  Rng rng(4);
  float first = 0, second = 0;
  double m = 0, v = 0;
  for (int step = 1; step <= 500; ++step) {
    const auto gradient = static_cast<float>(rng.Normal());
    const float moved = MoveByAdam(gradient, AdamMoveOf(0.002, step, 1e-8), &first, &second);
    m = 0.9 * m + 0.1 * gradient, v = 0.999 * v + 0.001 * gradient * gradient;
    const double expected = 0.002 * (m / (1 - std::pow(0.9, step))) / (std::sqrt(v / (1 - std::pow(0.999, step))) + 1e-8);
    ASSERT_NEAR(moved, expected, 1e-8) << step;
  }
}

TEST(Adam, StaysFiniteAtTheEndsOfFloat) {
  for (const float gradient : {0.f, std::numeric_limits<float>::denorm_min(), 1e-30f, 1e18f}) {
    float first = 0, second = 0;
    for (int step = 1; step <= 3; ++step) {
      const float moved = MoveByAdam(gradient, AdamMoveOf(0.1, step, 1e-8), &first, &second);
      EXPECT_TRUE(moved >= 0 && moved <= 0.1001f) << gradient << ": " << moved;
    }
  }
}

}  // namespace
}  // namespace mvstudio
