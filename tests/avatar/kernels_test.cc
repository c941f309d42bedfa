// Gradients of everything written by hand between the network's input and the loss, against central differences in double.
#include <ATen/ATen.h>

#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "avatar/maps/camera_tensor.h"
#include "avatar/maps/texture.h"
#include "avatar/nets/discriminator.h"
#include "avatar/nets/feature_net.h"
#include "avatar/nets/generator.h"
#include "avatar/nets/model.h"
#include "avatar/run/evaluate/posenet_features.h"
#include "avatar/train/adam.h"
#include "avatar/train/losses.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

using Tensors = std::vector<at::Tensor>;
using Function = std::function<at::Tensor(const Tensors&)>;  // to a scalar

at::Tensor Random(at::IntArrayRef sizes, uint64_t seed, double low = -1, double high = 1) {
  Rng rng(seed);
  at::Tensor x = at::empty(sizes, at::kDouble);
  double* p = x.data_ptr<double>();
  for (int64_t i = 0; i < x.numel(); ++i) p[i] = rng.Uniform(low, high);
  return x;
}

/// A number from a tensor in which every element counts differently.
at::Tensor Weighted(const at::Tensor& x) { return (x * Random(x.sizes(), 99).to(x.dtype())).sum(); }

/// (f(x + h d) - f(x - h d)) / 2h.
double AlongDirection(const Function& f, const Tensors& inputs, const Tensors& direction, double h) {
  const at::NoGradGuard no_gradients;
  Tensors plus, minus;
  for (size_t i = 0; i < inputs.size(); ++i) {
    plus.push_back(inputs[i] + h * direction[i]), minus.push_back(inputs[i] - h * direction[i]);
  }
  return (f(plus) - f(minus)).item<double>() / (2 * h);
}

/// Largest |gradient - central difference| over up to 25 elements of each input and three directions in which all elements
/// move, relative to the largest gradient of the input (to the length of the whole gradient for directions). 1 when an input
/// has no gradient.
double GradientError(const Function& f, const Tensors& at_inputs, double h = 1e-6) {
  Tensors inputs, gradients, still;
  for (const at::Tensor& x : at_inputs) inputs.push_back(x.detach().clone().requires_grad_());
  f(inputs).backward();
  for (at::Tensor& x : inputs) {
    if (!x.grad().defined() || x.grad().abs().max().item<double>() == 0) return 1;
    gradients.push_back(x.grad().clone()), still.push_back(at::zeros_like(x));
    x = x.detach();
  }
  double worst = 0, length2 = 0;
  for (size_t k = 0; k < inputs.size(); ++k) {
    const double scale = gradients[k].abs().max().item<double>();
    const int64_t count = inputs[k].numel(), probes = std::min<int64_t>(count, 25);
    for (int64_t i = 0; i < probes; ++i) {
      Tensors direction = still;
      direction[k] = at::zeros_like(inputs[k]);
      direction[k].flatten()[i * count / probes] = 1;
      const double expected = gradients[k].flatten()[i * count / probes].item<double>();
      worst = std::max(worst, std::abs(AlongDirection(f, inputs, direction, h) - expected) / scale);
    }
    length2 += gradients[k].square().sum().item<double>();
  }
  for (uint64_t d = 0; d < 3; ++d) {
    Tensors direction;
    double expected = 0;
    for (size_t k = 0; k < inputs.size(); ++k) {
      direction.push_back(Random(inputs[k].sizes(), 1000 + 10 * d + k).to(inputs[k].dtype()));
      expected += (direction[k] * gradients[k]).sum().item<double>();
    }
    worst = std::max(worst, std::abs(AlongDirection(f, inputs, direction, h) - expected) / std::sqrt(length2));
  }
  return worst;
}

constexpr double kBound = 1e-6;

TEST(Gradients, Textures) {
  const at::Tensor prob = at::softmax(Random({2, 25, 4, 3}, 1, -2, 2), 1);
  const auto f = [](const Tensors& x) { return Weighted(SampleTextures(x[0], x[1], x[2], x[3])); };
  EXPECT_LT(GradientError(f, {Random({24, 3, 5, 5}, 2), prob, Random({2, 48, 4, 3}, 3, -0.95, 0.95), Random({3}, 4, 0, 1)}),
            kBound);
  // coordinates beyond the borders, which repeat
  EXPECT_LT(GradientError(f, {Random({24, 3, 5, 5}, 2), prob, Random({2, 48, 4, 3}, 5, -1.4, 1.4), Random({3}, 4, 0, 1)}),
            kBound);
}

TEST(Gradients, ComposedImages) {
  const at::Tensor background = Random({3}, 6, 0, 1), previous = Random({2, 6, 5, 4}, 7, 0, 1);
  for (const char* method : {"tna", "direct", "v2v"}) {
    const bool tna = std::string(method) == "tna";
    AvatarModel model;
    FromString(method, &model.options.method);
    const auto f = [&](const Tensors& x) {
      if (tna) model.textures = x[2];
      return Weighted(ComposeImage(model, x[0], x[1], background, previous));
    };
    Tensors inputs = {Random({2, tna ? 25 : 1, 5, 4}, 8, -2, 2), Random({2,
                                                                         tna                            ? 48
                                                                         : std::string(method) == "v2v" ? 6
                                                                                                        : 3,
                                                                         5, 4},
                                                                        9, -1.5, 1.5)};
    if (tna) inputs.push_back(Random({24, 3, 6, 6}, 10));
    if (std::string(method) == "v2v") inputs[1] = inputs[1] * 0.05 + 0.011;  // flows of less than 2 px
    EXPECT_LT(GradientError(f, inputs, tna ? 1e-6 : 1e-7), kBound) << method;
  }
}

TEST(Gradients, Warp) {
  const auto f = [](const Tensors& x) { return Weighted(Warp(x[0], x[1])); };
  EXPECT_LT(GradientError(f, {Random({2, 3, 7, 6}, 11), Random({2, 2, 7, 6}, 12, -2.9, 2.9)}), kBound);
}

TEST(Gradients, SilhouetteInBothForms) {
  const at::Tensor mask = Random({2, 4, 5}, 13, 0, 1);
  for (const int64_t channels : {1, 25}) {
    for (const double scale : {1.0, 30.0}) {  // 30: where the cross-entropy of a rounded softmax has lost its gradient
      const auto f = [&](const Tensors& x) { return MaskLoss(x[0], mask); };
      EXPECT_LT(GradientError(f, {scale * Random({2, channels, 4, 5}, 14)}), kBound) << channels << " " << scale;
    }
  }
}

TEST(Gradients, PartsAndCoordinates) {
  const at::Tensor part = Random({2, 5, 4}, 15, 0, 24.99).to(at::kLong), target = Random({2, 2, 5, 4}, 16);
  EXPECT_LT(GradientError([&](const Tensors& x) { return PartLoss(x[0], part); }, {Random({2, 25, 5, 4}, 17, -3, 3)}), kBound);
  EXPECT_LT(GradientError([&](const Tensors& x) { return UvLoss(x[0], target, part); }, {Random({2, 48, 5, 4}, 18)}), kBound);
}

TEST(Gradients, ImageTerms) {
  const at::Tensor b = Random({2, 3, 16, 12}, 19, 0, 1), a = Random({2, 3, 16, 12}, 20, 0, 1),
                   mask = Random({2, 16, 12}, 21, 0, 1);
  EXPECT_LT(GradientError([&](const Tensors& x) { return WeightedL1(x[0], b, mask, 10); }, {a}), kBound);
  EXPECT_LT(GradientError([&](const Tensors& x) { return SsimLoss(x[0], b, mask, 10); }, {a}), kBound);
  EXPECT_LT(GradientError([&](const Tensors& x) { return SsimLoss(x[0], b, mask, 10); }, {b + 0.01 * a}), kBound)
      << "nearly equal pictures";
  EXPECT_LT(GradientError([&](const Tensors& x) { return GradientLoss(x[0], b, PixelWeights(mask, 10)); }, {a}), kBound);
  EXPECT_LT(GradientError([](const Tensors& x) { return SaturationLoss(x[0], 4); }, {8 * a - 4.5}), kBound);
}

/// The image, and its squares at half the size.
class SquareNet : public FeatureNet {
 public:
  std::string name() const override { return "square"; }
  Tensors Levels(const at::Tensor& rgb) const override { return {rgb, at::avg_pool2d(rgb, 2).square()}; }
};

TEST(Gradients, PerceptualTerm) {
  const SquareNet net;
  const at::Tensor b = Random({1, 3, 8, 8}, 22, 0, 1), weights = PixelWeights(Random({1, 8, 8}, 24, 0, 1), 10);
  EXPECT_LT(
      GradientError([&](const Tensors& x) { return PerceptualLoss(net, x[0], b, weights); }, {Random({1, 3, 8, 8}, 23, 0, 1)}),
      kBound);
}

TEST(Gradients, Projection) {
  const at::Tensor x_in_cam = Random({2, 19, 3}, 24) + at::tensor({0.0, 0.0, 3.0}, at::kDouble);
  const at::Tensor intrinsics = at::tensor({120.0, 121.0, 30.0, 31.0}, at::kDouble).expand({2, 4});
  const auto f = [](const Tensors& x) { return Weighted(ProjectPinhole(x[0], x[1])); };
  EXPECT_LT(GradientError(f, {intrinsics, x_in_cam}), kBound);
}

/// The same over the weights of a module; moves them in place.
double WeightError(torch::nn::Module& module, const std::function<at::Tensor()>& f) {
  Tensors weights;
  for (const at::Tensor& weight : module.parameters()) weights.push_back(weight.detach().clone());
  const auto moved = [&](const Tensors& to) {
    const at::NoGradGuard no_gradients;
    for (size_t i = 0; i < to.size(); ++i) at::Tensor(module.parameters()[i]).copy_(to[i]);
    return f();
  };
  module.zero_grad();
  f().backward();
  Tensors gradients;
  double length2 = 0, worst = 0;
  for (const at::Tensor& weight : module.parameters()) {
    gradients.push_back(weight.grad().clone());
    length2 += gradients.back().square().sum().item<double>();
  }
  for (uint64_t d = 0; d < 4; ++d) {
    Tensors direction;
    double expected = 0;
    for (size_t k = 0; k < weights.size(); ++k) {
      direction.push_back(Random(weights[k].sizes(), 2000 + 100 * d + k));
      expected += (direction[k] * gradients[k]).sum().item<double>();
    }
    worst = std::max(worst, std::abs(AlongDirection(moved, weights, direction, 1e-8) - expected) / std::sqrt(length2));
  }
  return worst;
}

TEST(Gradients, NetworksInDouble) {
  for (const char* upsample : {"nearest", "transposed"}) {
    ModelOptions o;
    o.width = 3, o.downs = 2, o.encoder_blocks = o.decoder_blocks = 1;
    FromString(upsample, &o.upsample);
    Generator generator(o, 3);
    generator->to(at::kDouble);
    const at::Tensor maps = Random({1, 36, 16, 16}, 25);
    const auto outputs = [&](const at::Tensor& x) {
      const auto [first, second] = generator->forward(x);
      return Weighted(first) + Weighted(second);
    };
    EXPECT_LT(GradientError([&](const Tensors& x) { return outputs(x[0]); }, {maps}, 1e-7), 1e-5) << upsample;
    EXPECT_LT(WeightError(*generator, [&] { return outputs(maps); }), 1e-5) << upsample;
  }
  Discriminator critic(5, 4, 2, 2, 1);
  critic->to(at::kDouble);
  const at::Tensor image = Random({1, 5, 32, 32}, 26), truth = Random({1, 5, 32, 32}, 27);
  const auto loss = [&](const at::Tensor& x) {
    const PatchFeatures fake = critic->forward(x);
    return PatchLoss(fake, true) + PatchLoss(fake, false) + FeatureMatching(fake, critic->forward(truth));
  };
  EXPECT_LT(GradientError([&](const Tensors& x) { return loss(x[0]); }, {image}, 1e-7), 1e-5);
}

/// Its graph works in float32: differences of a hundredth, along its own gradient and at random.
TEST(Gradients, PoseNetInFloat) {
  std::shared_ptr<const FeatureNet> net;
  try {
    net = PoseNetFeatures();
  } catch (const MissingToolError& error) {
    GTEST_SKIP() << error.what();
  }
  const at::Tensor a = Random({1, 3, 64, 64}, 28, 0.2, 0.8).to(at::kFloat),
                   b = Random({1, 3, 64, 64}, 29, 0.2, 0.8).to(at::kFloat);
  at::Tensor x = a.clone().requires_grad_();
  const at::Tensor weights = at::full({1, 1, 64, 64}, 1.0 / 4096);
  PerceptualLoss(*net, x, b, weights).backward();
  const at::Tensor gradient = x.grad() / x.grad().norm();
  for (const at::Tensor& direction : {gradient, (gradient + Random(a.sizes(), 30).to(at::kFloat) / 100)}) {
    const auto f = [&](const Tensors& y) { return PerceptualLoss(*net, y[0], b, weights).to(at::kDouble); };
    const double expected = (direction * x.grad()).sum().item<double>();
    EXPECT_NEAR(AlongDirection(f, {a}, {direction}, 0.01) / expected, 1, 0.02);
  }
}

/// Kingma and Ba's algorithm 1, number by number; sizes beyond one share of a thread, and in double by tensor operations.
TEST(AdamStep, IsTheDefinition) {
  for (const at::ScalarType type : {at::kFloat, at::kDouble}) {
    const int64_t count = 70001;
    at::Tensor value = Random({count}, 40).to(type).requires_grad_();
    const at::Tensor start = value.detach().to(at::kDouble).clone();
    Adam adam;
    adam.Add("x", value);
    for (uint64_t t = 0; t < 5; ++t) {
      value.mutable_grad() = (t == 2 ? 1e-12 : 1.0) * Random({count}, 41 + t).to(type);
      adam.Step(0.01);
    }
    for (const int64_t i : {int64_t{0}, int64_t{5}, int64_t{32768}, count - 1}) {
      double x = start[i].item<double>(), m = 0, v = 0;
      for (uint64_t t = 0; t < 5; ++t) {
        const double g = ((t == 2 ? 1e-12 : 1.0) * Random({count}, 41 + t).to(type))[i].item<double>(),
                     n = static_cast<double>(t) + 1;
        m = 0.9 * m + 0.1 * g, v = 0.999 * v + 0.001 * g * g;
        x -= 0.01 * (m / (1 - std::pow(0.9, n))) / (std::sqrt(v / (1 - std::pow(0.999, n))) + 1e-8);
      }
      EXPECT_NEAR(value[i].item<double>(), x, type == at::kFloat ? 3e-7 : 1e-14) << i;
    }
  }
}

/// Each value by algorithm 1 over the steps that have a gradient for it, alone.
TEST(AdamStep, OfSparseValuesCountsTheStepsThatShowThem) {
  for (const at::ScalarType type : {at::kFloat, at::kDouble}) {
    at::Tensor value = at::zeros({3}, type).requires_grad_();
    Adam adam;
    adam.AddSparse("x", value);
    const std::array<std::array<double, 3>, 4> gradients = {{{1, 0, 0}, {-0.5, 0, 2}, {0, 0, 0}, {0.25, 0, 1}}};
    for (const auto& g : gradients) {
      value.mutable_grad() = at::tensor({g[0], g[1], g[2]}, at::kDouble).to(type);
      adam.Step(0.01);
    }
    for (int i = 0; i < 3; ++i) {
      double x = 0, m = 0, v = 0, n = 0;
      for (const auto& g : gradients) {
        if (g[i] == 0) continue;
        ++n, m = 0.9 * m + 0.1 * g[i], v = 0.999 * v + 0.001 * g[i] * g[i];
        x -= 0.01 / std::sqrt(1 + n / 20) * (m / (1 - std::pow(0.9, n))) / (std::sqrt(v / (1 - std::pow(0.999, n))) + 1e-8);
      }
      EXPECT_NEAR(value[i].item<double>(), x, type == at::kFloat ? 1e-7 : 1e-14) << i;
      EXPECT_EQ(adam.slots[0].count[i].item<double>(), n);
    }
  }
}

}  // namespace
}  // namespace mvstudio::avatar
