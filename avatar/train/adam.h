#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace mvstudio::avatar {

/// Adam (Kingma and Ba, ICLR 2015) over named tensors, beta 0.9 and 0.999, epsilon 1e-8. Its whole state is public,
/// because it is part of checkpoints.
struct Adam {
  struct Slot {
    std::string name;
    at::Tensor value;          // a leaf with gradient
    at::Tensor first, second;  // moments, same shape
    at::Tensor count;          // number of steps of each value, same shape; undefined: `step`
  };
  std::vector<Slot> slots;
  int64_t step = 0;

  void Add(const std::string& name, const at::Tensor& value);
  /// As Add, for values that most steps say nothing of, as texels: one moves, and its moments age, only in steps that have a
  /// gradient for it, and its step size falls with their number.
  void AddSparse(const std::string& name, const at::Tensor& value);
  /// One step for every slot that has a gradient.
  void Step(double learning_rate);
  void ClearGradients();
  /// Euclidean length of all gradients together; NaN or infinity when one of them is not finite.
  double GradientNorm() const;
  void ScaleGradients(double factor);
};

}  // namespace mvstudio::avatar
