#include "avatar/surface/offset_net.h"

#include <gtest/gtest.h>
#include <torch/torch.h>

#include <numeric>

#include "avatar/io/surface/moving_surface.h"
#include "avatar/io/surface/network_training.h"
#include "avatar/io/surface/silhouette_function.h"
#include "avatar/train/adam.h"
#include "tests/body/swelling_take.h"

/// The network of a surface that moves with the pose, and its training.
namespace mvstudio::avatar {
namespace {

using body::testing::OneThread;
using body::testing::SwellingTake;

OffsetAtlas SmallAtlas() { return {16, 24, at::linspace(-0.9, 0.9, 14).view({7, 2})}; }

TEST(OffsetNet, BeginsAtZeroAndStaysInItsBounds) {
  const OffsetNetOptions options{4, 5, 6, 8, 0.1};
  OffsetNet net(options, SmallAtlas(), 3), same(options, SmallAtlas(), 3), other(options, SmallAtlas(), 4);
  const at::Tensor positions = at::randn({1, 3, 16, 24});
  EXPECT_EQ(net->forward(positions).abs().max().item<float>(), 0);
  EXPECT_TRUE(at::equal(net->named_parameters()["layer2.weight"], same->named_parameters()["layer2.weight"]));
  EXPECT_FALSE(at::equal(net->named_parameters()["layer2.weight"], other->named_parameters()["layer2.weight"]));
  const torch::NoGradGuard no_gradients;
  for (auto& value : net->parameters()) value.mul_(100).add_(1);
  const at::Tensor far = net->forward(positions);
  EXPECT_EQ(far.sizes(), at::IntArrayRef({7, 3}));
  EXPECT_LE(far.abs().max().item<float>(), 0.1f);
  EXPECT_GT(far.abs().max().item<float>(), 0.09f);
}

TEST(OffsetNet, EveryWeightLearns) {
  OffsetNet net(OffsetNetOptions{4, 5, 6, 8, 0.1}, SmallAtlas(), 3);
  Adam adam;
  for (auto& parameter : net->named_parameters()) adam.Add(parameter.key(), parameter.value());
  const at::Tensor positions = at::randn({1, 3, 16, 24});
  double first = 0, last = 0;
  for (int i = 0; i < 60; ++i) {
    const at::Tensor loss = (net->forward(positions) - 0.03).pow(2).mean();
    (i == 0 ? first : last) = loss.item<double>();
    adam.ClearGradients();
    loss.backward();
    if (i == 5) {
      for (const auto& parameter : net->named_parameters())
        EXPECT_GT(parameter.value().grad().abs().max().item<float>(), 0) << parameter.key();
    }
    adam.Step(1e-2);
  }
  EXPECT_LT(last, 0.05 * first);
}

TEST(SilhouetteOfOffsets, HasTheGradientOfItsDifferences) {
  const SwellingTake take(15, 0.15);
  const body::TakeOutlines outlines = TakeOutlinesOf(take.person, take.steps, {}, OneThread());
  const SilhouetteViews views{&outlines, &outlines.steps[2], {0, 2}, {1e-3}};
  const int64_t count = outlines.body.vertices.cols();
  const at::Tensor at_rest = at::zeros({count, 3}).requires_grad_();
  SilhouetteOfOffsets(at_rest, views).backward();
  const at::Tensor along = at_rest.grad() / at_rest.grad().norm();
  const double slope = (at_rest.grad() * along).sum().item<double>();
  const auto at = [&](double step) { return SilhouetteOfOffsets((step * along).detach(), views).item<double>(); };
  constexpr double kStep = 0.02;  // metres over all vertices together: float32 carries it
  EXPECT_NEAR((at(kStep) - at(-kStep)) / (2 * kStep), slope, 0.1 * slope);
  EXPECT_LT(at(-kStep), at(0));
}

TEST(NetworkTraining, LearnsWhatMovesWithThePose) {
  const SwellingTake take(18, 0.15);
  const body::TakeOutlines outlines = TakeOutlinesOf(take.person, take.steps, {}, OneThread());
  NetworkTrainingOptions options;
  options.net = {4, 8, 8, 16, 0.1}, options.steps = 150, options.views_per_step = 3, options.learning_rate = 3e-3;
  const NetworkTraining training(outlines, options, OneThread());
  std::vector<int> all(outlines.steps.size());
  std::iota(all.begin(), all.end(), 0);
  const body::PoseOffsets offsets = training.Train(all);
  const auto mean = [&](const std::optional<body::PoseOffsets>& of) {
    const std::vector<double> losses = StepLosses(outlines, all, of, OneThread());
    return std::accumulate(losses.begin(), losses.end(), 0.0) / static_cast<double>(losses.size());
  };
  EXPECT_LT(mean(offsets), 0.8 * mean(std::nullopt));
  const auto again = training.Train(all);
  EXPECT_EQ(offsets(outlines.steps[4].seen), again(outlines.steps[4].seen)) << "the seed decides";
}

TEST(FitMovingSurface, AddsToTheBodyOnlyWhatIsKept) {
  const SwellingTake take(18, 0.15);
  body::PersonBody off = take.person, moving = take.person;
  EXPECT_TRUE(FitMovingSurface(take.steps, {}, body::DynamicMode::kOff, OneThread(), &off).reason.empty());
  EXPECT_EQ(off.body.pose_directions.size(), 0);
  const body::DynamicFit fit = FitMovingSurface(take.steps, {}, body::DynamicMode::kAuto, OneThread(), &moving);
  ASSERT_TRUE(fit.offsets) << fit.reason;
  const body::BodyPose pose = ToBodyPose(moving.body, take.person.seen.at(12));
  const Eigen::Matrix3Xf expected = SkinVertices(WithOffsets(off.body, fit.offsets->At(take.person.seen.at(12))), pose);
  EXPECT_LT((SkinVertices(moving.body, pose) - expected).cwiseAbs().maxCoeff(), 1e-5f);
}

}  // namespace
}  // namespace mvstudio::avatar
