#include "avatar/train/adam.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <cmath>
#include <vector>

#include "core/optimise/adam.h"

namespace mvstudio::avatar {
namespace {

constexpr double kEpsilon = 1e-8;

bool IsPlain(const at::Tensor& x) { return x.is_cpu() && x.scalar_type() == at::kFloat && x.is_contiguous(); }

/// One pass over the memory instead of eight. Clones without fused multiply-add: machines agree to the last bit.
__attribute__((target_clones("avx2", "default"))) void StepRange(const float* gradient, float* __restrict first,
                                                                 float* __restrict second, float* __restrict value,
                                                                 int64_t count, AdamMove move) {
  for (int64_t i = 0; i < count; ++i) value[i] -= MoveByAdam(gradient[i], move, first + i, second + i);
}

void StepPlain(const Adam::Slot& slot, const at::Tensor& gradient, const AdamMove& move) {
  constexpr int64_t kGrain = 1 << 15;
  const float* g = gradient.data_ptr<float>();
  float *first = slot.first.data_ptr<float>(), *second = slot.second.data_ptr<float>(), *value = slot.value.data_ptr<float>();
  at::parallel_for(0, gradient.numel(), kGrain, [&](int64_t begin, int64_t end) {
    StepRange(g + begin, first + begin, second + begin, value + begin, end - begin, move);
  });
}

// A value's steps fall as 1 / sqrt(1 + n / 20) with their number n: what an image shows of a texel is noisy, and less and less
// of it stays in the colour (rate of Zinkevich, "Online convex programming and generalized infinitesimal gradient ascent",
// 2003).
constexpr double kHalfDecay = 20;

/// Of a value's n-th own step: its size, with the correction of the first moment; the inverse correction of the second.
struct OwnStep {
  float rate, inverse_correction2;
};

OwnStep OwnStepOf(double n) {
  const double fall = 1 / std::sqrt(1 + n / kHalfDecay);
  return {static_cast<float>(fall / (1 - std::pow(0.9, n))), static_cast<float>(1 / (1 - std::pow(0.999, n)))};
}

/// For n = 0, 1, …, `count`.
const std::vector<OwnStep>& OwnSteps(size_t count) {
  static thread_local std::vector<OwnStep> steps;
  while (steps.size() <= count) steps.push_back(OwnStepOf(static_cast<double>(steps.size())));
  return steps;
}

void StepSparsePlain(const Adam::Slot& slot, const at::Tensor& gradient, double rate) {
  const float* g = gradient.data_ptr<float>();
  float *first = slot.first.data_ptr<float>(), *second = slot.second.data_ptr<float>(), *value = slot.value.data_ptr<float>();
  float* count = slot.count.data_ptr<float>();
  const std::vector<OwnStep>& steps = OwnSteps(static_cast<size_t>(slot.count.max().item<float>()) + 1);
  for (int64_t i = 0; i < gradient.numel(); ++i) {
    if (g[i] == 0) continue;
    const OwnStep& own = steps[static_cast<size_t>(++count[i])];
    const AdamMove move{static_cast<float>(rate) * own.rate, own.inverse_correction2};
    value[i] -= MoveByAdam(g[i], move, first + i, second + i);
  }
}

void StepSparseTensors(const Adam::Slot& slot, const at::Tensor& gradient, double rate) {
  const at::Tensor seen = gradient.ne(0);
  slot.count.add_(seen);
  slot.first.copy_(at::where(seen, 0.9 * slot.first + 0.1 * gradient, slot.first));
  slot.second.copy_(at::where(seen, 0.999 * slot.second + 0.001 * gradient.square(), slot.second));
  const at::Tensor correction1 = 1 - at::pow(0.9, slot.count), correction2 = 1 - at::pow(0.999, slot.count);
  const at::Tensor fall = (1 + slot.count / kHalfDecay).rsqrt();
  const at::Tensor move = fall * slot.first / correction1 / ((slot.second / correction2).sqrt() + 1e-8);
  slot.value.detach().sub_(at::where(seen, rate * move, at::zeros_like(move)));
}

void StepTensors(const Adam::Slot& slot, const at::Tensor& gradient, double learning_rate, double step) {
  slot.first.mul_(0.9).add_(gradient, 0.1);
  slot.second.mul_(0.999).addcmul_(gradient, gradient, 0.001);
  const at::Tensor scale = (slot.second / (1 - std::pow(0.999, step))).sqrt_().add_(1e-8);
  slot.value.detach().addcdiv_(slot.first, scale, -learning_rate / (1 - std::pow(0.9, step)));
}

}  // namespace

void Adam::Add(const std::string& name, const at::Tensor& value) {
  slots.push_back({name, value, at::zeros_like(value.detach()), at::zeros_like(value.detach()), {}});
}

void Adam::AddSparse(const std::string& name, const at::Tensor& value) {
  Add(name, value);
  slots.back().count = at::zeros_like(value.detach());
}

void Adam::Step(double learning_rate) {
  ++step;
  const AdamMove move = AdamMoveOf(learning_rate, step, kEpsilon);
  for (Slot& slot : slots) {
    const at::Tensor gradient = slot.value.grad();
    if (!gradient.defined()) continue;
    const bool plain = IsPlain(gradient) && IsPlain(slot.value) && IsPlain(slot.first) && IsPlain(slot.second);
    if (slot.count.defined()) {
      (plain ? StepSparsePlain : StepSparseTensors)(slot, gradient, learning_rate);
    } else if (plain) {
      StepPlain(slot, gradient, move);
    } else {
      StepTensors(slot, gradient, learning_rate, static_cast<double>(step));
    }
  }
}

void Adam::ClearGradients() {
  for (Slot& slot : slots) slot.value.mutable_grad() = at::Tensor();
}

double Adam::GradientNorm() const {
  double sum = 0;
  for (const Slot& slot : slots) {
    if (slot.value.grad().defined()) sum += std::pow(slot.value.grad().norm().item<double>(), 2);
  }
  return std::sqrt(sum);
}

void Adam::ScaleGradients(double factor) {
  for (Slot& slot : slots) {
    if (slot.value.grad().defined()) slot.value.mutable_grad().mul_(factor);
  }
}

}  // namespace mvstudio::avatar
