#include "avatar/adam.h"

#include <ATen/ATen.h>

#include <cmath>

namespace mvstudio::avatar {

void Adam::Add(const std::string& name, const at::Tensor& value) {
  slots.push_back({name, value, at::zeros_like(value.detach()), at::zeros_like(value.detach())});
}

void Adam::Step(double learning_rate) {
  ++step;
  const double correction1 = 1 - std::pow(0.9, static_cast<double>(step)),
               correction2 = 1 - std::pow(0.999, static_cast<double>(step));
  for (Slot& slot : slots) {
    const at::Tensor gradient = slot.value.grad();
    if (!gradient.defined()) continue;
    slot.first.mul_(0.9).add_(gradient, 0.1);
    slot.second.mul_(0.999).addcmul_(gradient, gradient, 0.001);
    const at::Tensor scale = (slot.second / correction2).sqrt_().add_(1e-8);
    slot.value.detach().addcdiv_(slot.first, scale, -learning_rate / correction1);
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
