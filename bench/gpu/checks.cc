#include "bench/gpu/checks.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "avatar/lift/lift.h"
#include "bench/gpu/device.h"
#include "bench/gpu/learner.h"

namespace mvstudio::avatar {
namespace {

const at::Device kCpu(at::kCPU);

/// Largest errors allowed: gradients in float64 of the worst tensor, in coarser arithmetic of all tensors together.
struct Bounds {
  double float64, float32, tf32, half, step, image;
};
constexpr double kLevel = 1.0 / 255;  // of the 8-bit images that are written
constexpr Bounds kSmall = {1e-10, 1e-3, 0.1, 0.15, 1e-5, kLevel};
// Rounding alone moves these by 1e-9 in float64 and 2e-2 in float32, on the CPU alone: kinks (ReLU, |x|, texels' edges) fall on
// either side. Weights rounded to the 10 bits of TF32 and half precision give other gradients altogether, so that only a
// training can judge them: no bound.
constexpr double kNoBound = 0;
constexpr Bounds kFull = {1e-7, 5e-2, kNoBound, kNoBound, 1e-4, kLevel};

/// The largest of the network's tensors is off by a share.
void Spoil(double share, Groups* gradients) {
  if (share == 0) return;
  Group& group = gradients->at("network");
  const auto smaller = [](const auto& a, const auto& b) {
    return a.second.norm().template item<double>() < b.second.norm().template item<double>();
  };
  std::max_element(group.begin(), group.end(), smaller)->second.mul_(1 + share);
}

struct Precision {
  const char* name;
  at::ScalarType type;
  bool tf32, half;
  double bound;
};

/// The gradients' distance from the reference.
double GradientError(const Net& net, const AvatarPack& pack, const at::Device& device, const Precision& p, double spoil,
                     const Groups& reference) {
  AllowTf32(p.tf32);
  Learner learner(net, pack, pack.size(), device, p.type);
  learner.Gradients(p.half);
  Groups gradients = learner.GradientsNow();
  AllowTf32(false);
  Spoil(spoil, &gradients);
  return p.type == at::kDouble ? WorstTensor(gradients, reference) : WorstGroup(gradients, reference);
}

/// In steps of the learning rate: the largest distance of two networks' weights.
double WeightDistance(const Groups& a, const Groups& b) {
  double largest = 0;
  for (const auto& [name, tensor] : b.at("network"))
    largest = std::max(largest, (a.at("network").at(name) - tensor).abs().max().item<double>());
  return largest / TrainOptions().learning_rate;
}

/// After the step by the gradients that are there, and more.
Groups WeightsAfter(int steps, Learner* learner) {
  learner->Move();
  for (int k = 1; k < steps; ++k) learner->Gradients(false), learner->Move();
  return learner->WeightsNow();
}

at::Tensor Image(const Net& net, const AvatarPack& pack, const at::Device& device) {
  Learner learner(net, pack, 1, device, at::kFloat);
  const PoseBatch pose = PosesOf(pack, at::zeros({1}, at::kLong));
  return Render(learner.model(), pose, net.size_px, net.size_px).image;
}

void CheckNet(const Net& net, const at::Device& device, double spoil, Report* report) {
  const bool large = net.size_px > 100;
  const std::string name = net.name + (large ? ", 512 px" : ", small");
  const AvatarPack pack = PackFor(net, large ? 1 : 2);
  const int steps = large ? 1 : 2;
  Groups reference, weights;
  {
    Learner exact(net, pack, pack.size(), kCpu, at::kDouble);
    exact.Gradients(false);
    reference = exact.GradientsNow();
    weights = WeightsAfter(steps, &exact);
  }
  const Bounds& bounds = large ? kFull : kSmall;
  const auto check = [&](const Precision& p) {
    const double error = GradientError(net, pack, device, p, spoil, reference);
    if (p.bound > 0)
      report->Check(p.name, name, error, p.bound);
    else
      report->Row({name, p.name, Scientific(error), "none", ""});
  };
  check({"gradient, float64, worst tensor", at::kDouble, false, false, bounds.float64});
  check({"gradient, float32, all", at::kFloat, false, false, bounds.float32});
  if (device.is_cuda()) {
    check({"gradient, TF32 convolutions, all", at::kFloat, true, false, bounds.tf32});
    check({"gradient, half precision (`--amp`), all", at::kFloat, true, true, bounds.half});
  }
  Learner other(net, pack, pack.size(), device, at::kDouble);
  other.Gradients(false);
  report->Check("weights after " + std::to_string(steps) + " step(s), float64, in learning rates", name,
                WeightDistance(WeightsAfter(steps, &other), weights), bounds.step);
  report->Check("rendered image, float32, largest difference", name,
                (Image(net, pack, device) - Image(net, pack, kCpu)).abs().max().item<double>(), bounds.image);
}

Group LifterGradients(const at::Tensor& inputs, const at::Device& device, at::ScalarType type) {
  Lifter lifter = MakeLifter({}, 1);
  for (auto& [name, weight] : lifter.weights) weight = weight.to(device, type).requires_grad_();
  const at::Tensor joints = Lift(lifter, inputs.to(device, type));
  (joints - 1).square().sum(2).add(1e-12).sqrt().mean().backward();
  Group gradients;
  for (const auto& [name, weight] : lifter.weights) gradients[name] = weight.grad().to(at::kCPU, at::kDouble);
  return gradients;
}

/// Values after steps of gradients that grow, shrink, change sign and are at times 0.
at::Tensor AfterAdam(bool sparse, const at::Device& device, at::ScalarType type) {
  at::manual_seed(5);
  const at::Tensor start = 0.02 * at::randn({20000}), gradient = at::randn({20000}) * (at::rand({20000}) > 0.1);
  const at::Tensor value = start.to(device, type).requires_grad_();
  Adam adam;
  sparse ? adam.AddSparse("x", value) : adam.Add("x", value);
  const at::NoGradGuard no_gradients;
  for (int k = 0; k < 20; ++k) {
    value.mutable_grad() = (gradient * std::cos(k)).to(device, type);
    adam.Step(TrainOptions().learning_rate);
  }
  return value.detach().to(at::kCPU, at::kDouble);
}

}  // namespace

void CheckNets(const std::vector<Net>& nets, const at::Device& device, double spoil, Report* report) {
  for (const Net& net : nets) {
    if (report->TimeFor("checks of " + net.name)) CheckNet(net, device, spoil, report);
  }
}

void CheckLifter(const at::Device& device, Report* report) {
  at::manual_seed(4);
  const at::Tensor inputs = at::randn({128, kLiftInputs});
  const Groups reference = {{"network", LifterGradients(inputs, kCpu, at::kDouble)}};
  const auto error = [&](at::ScalarType type) {
    return WorstTensor({{"network", LifterGradients(inputs, device, type)}}, reference);
  };
  report->Check("gradient, float64", "lifter", error(at::kDouble), kSmall.float64);
  report->Check("gradient, float32", "lifter", error(at::kFloat), kSmall.float32);
}

void CheckAdam(const at::Device& device, Report* report) {
  for (const bool sparse : {false, true}) {
    const at::Tensor exact = AfterAdam(sparse, kCpu, at::kDouble);
    const double off =
        (AfterAdam(sparse, device, at::kFloat) - exact).abs().max().item<double>() / TrainOptions().learning_rate;
    report->Check("20 steps with given gradients, float32, in learning rates", sparse ? "Adam of texels" : "Adam", off, 1e-3);
  }
}

}  // namespace mvstudio::avatar
