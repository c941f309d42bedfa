#include "avatar/train/adam.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <cmath>

namespace mvstudio::avatar {
namespace {

struct Rates {
  double step, correction2;  // learning rate over the first correction; the second correction
};

bool IsPlain(const at::Tensor& x) { return x.is_cpu() && x.scalar_type() == at::kFloat && x.is_contiguous(); }

/// One pass over the memory instead of eight. Clones without fused multiply-add: machines agree to the last bit.
__attribute__((target_clones("avx2", "default"), optimize("no-math-errno"))) void StepRange(
    const float* gradient, float* __restrict first, float* __restrict second, float* __restrict value, int64_t count,
    float rate, float inverse_correction2) {
  for (int64_t i = 0; i < count; ++i) {
    const float g = gradient[i], m = 0.9f * first[i] + 0.1f * g, v = 0.999f * second[i] + 0.001f * g * g;
    first[i] = m, second[i] = v;
    value[i] -= rate * m / (std::sqrt(v * inverse_correction2) + 1e-8f);
  }
}

void StepPlain(const Adam::Slot& slot, const at::Tensor& gradient, const Rates& rates) {
  constexpr int64_t kGrain = 1 << 15;
  const float* g = gradient.data_ptr<float>();
  float *first = slot.first.data_ptr<float>(), *second = slot.second.data_ptr<float>(), *value = slot.value.data_ptr<float>();
  at::parallel_for(0, gradient.numel(), kGrain, [&](int64_t begin, int64_t end) {
    StepRange(g + begin, first + begin, second + begin, value + begin, end - begin, static_cast<float>(rates.step),
              static_cast<float>(1 / rates.correction2));
  });
}

void StepTensors(const Adam::Slot& slot, const at::Tensor& gradient, const Rates& rates) {
  slot.first.mul_(0.9).add_(gradient, 0.1);
  slot.second.mul_(0.999).addcmul_(gradient, gradient, 0.001);
  const at::Tensor scale = (slot.second / rates.correction2).sqrt_().add_(1e-8);
  slot.value.detach().addcdiv_(slot.first, scale, -rates.step);
}

}  // namespace

void Adam::Add(const std::string& name, const at::Tensor& value) {
  slots.push_back({name, value, at::zeros_like(value.detach()), at::zeros_like(value.detach())});
}

void Adam::Step(double learning_rate) {
  ++step;
  const double correction1 = 1 - std::pow(0.9, static_cast<double>(step)),
               correction2 = 1 - std::pow(0.999, static_cast<double>(step));
  const Rates rates = {learning_rate / correction1, correction2};
  for (Slot& slot : slots) {
    const at::Tensor gradient = slot.value.grad();
    if (!gradient.defined()) continue;
    const bool plain = IsPlain(gradient) && IsPlain(slot.value) && IsPlain(slot.first) && IsPlain(slot.second);
    (plain ? StepPlain : StepTensors)(slot, gradient, rates);
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
