#pragma once

#include <ATen/core/Tensor.h>

#include <map>
#include <string>
#include <vector>

#include "avatar/nets/discriminator.h"
#include "avatar/nets/model.h"
#include "avatar/train/adam.h"
#include "avatar/train/loss_terms.h"
#include "bench/gpu/nets.h"

namespace mvstudio::avatar {

/// Tensors of one optimiser by name, on the CPU in double; by "network", "textures" and "critic".
using Group = std::map<std::string, at::Tensor>;
using Groups = std::map<std::string, Group>;

/// The largest over all tensors of |a - b| / (|b| + a thousandth of its group's length), Euclidean; NaN counts as infinity.
double WorstTensor(const Groups& a, const Groups& b);
/// The largest over the groups of |a - b| / |b|, of all their tensors together.
double WorstGroup(const Groups& a, const Groups& b);

/// A network that is neither new nor trained (no tensor of it is 0), one batch, and the steps of a Trainer's last phase: all
/// default loss terms, clipped gradients, Adam. The same numbers on every device and in every type, up to rounding.
class Learner {
 public:
  Learner(const Net& net, const AvatarPack& pack, int64_t batch, const at::Device& device, at::ScalarType type);

  /// The loss; its gradients are left in the tensors. `half`: half-precision convolutions and a scaled loss.
  double Gradients(bool half);
  /// A step of all optimisers by the gradients that are there.
  void Move();

  Groups GradientsNow() const;
  Groups WeightsNow() const;
  int64_t parameters() const;
  AvatarModel& model() { return model_; }

 private:
  bool v2v() const { return model_.options.method == Method::kV2v; }
  double ScaledGradients(bool half, double scale);
  Groups Copies(bool gradients) const;

  AvatarModel model_;
  Discriminator critic_{nullptr};
  TrainOptions options_;
  StepInput input_;
  std::map<std::string, Adam> adams_;
  double loss_scale_ = 65536;
};

}  // namespace mvstudio::avatar
