#include <torch/torch.h>

#include <numeric>

#include "avatar/run/surface/network_training.h"
#include "avatar/run/surface/silhouette_function.h"
#include "avatar/run/surface/trained_net.h"
#include "avatar/train/adam.h"
#include "tests/body/swelling_take.h"
#include "tests/support/one_thread.h"
#include "tests/support/test.h"

/// The network of a surface that moves with the pose, and its training.
namespace mvstudio::avatar {
namespace {

using body::testing::Small;
using body::testing::SwellingTake;
using body::testing::SwingingPose;

const body::OffsetNetSizes kSmallNet{4, 5, 6, 8};

Eigen::Matrix3Xf Posed(int i) { return PosedAboutRoot(Small(), ToBodyPose(Small(), SwingingPose(i))); }

struct SmallSurface {
  body::OffsetAtlas atlas = MakeOffsetAtlas(Small());
  body::OffsetSmoother smoother{Small(), body::kOffsetNetStiffness};
  body::PositionNorm norm = NormOf(atlas, {Posed(0), Posed(3), Posed(7)});

  TrainedNet Net(uint64_t seed) const { return {atlas, smoother, kSmallNet, norm, seed}; }
};

const SmallSurface& Surface() {
  static const SmallSurface surface;
  return surface;
}

void Shake(TrainedNet* net, double by) {
  const torch::NoGradGuard no_gradients;
  for (auto& [name, value] : net->parameters()) value.add_(at::randn_like(value), by);
}

TEST(TrainedNet, BeginsAtTheSurfaceThatSkinsAlone) {
  const TrainedNet net = Surface().Net(3), same = Surface().Net(3), other = Surface().Net(4);
  EXPECT_EQ(net.Forward(Posed(2)).abs().max().item<float>(), 0);
  const auto layer = [](const TrainedNet& of) { return of.Arrays().at("layer2.weight").values; };
  EXPECT_EQ(layer(net), layer(same));
  EXPECT_NE(layer(net), layer(other));
}

TEST(TrainedNet, SaysWhatTheNetworkOfTheFileSays) {
  TrainedNet net = Surface().Net(3);
  torch::manual_seed(1);
  Shake(&net, 0.1);
  const body::OffsetNet plain(Small(), net.Arrays());
  for (const int i : {1, 5}) {
    const at::Tensor offsets = net.Forward(Posed(i)).detach();
    const Eigen::Matrix3Xf expected = plain.At(Posed(i));
    ASSERT_GT(expected.cwiseAbs().maxCoeff(), 1e-3f);
    const Eigen::Map<const Eigen::Matrix3Xf> torch_offsets(offsets.data_ptr<float>(), 3, offsets.size(0));
    EXPECT_LT((torch_offsets - expected).cwiseAbs().maxCoeff(), 1e-6f) << i;
  }
  EXPECT_GT((plain.At(Posed(1)) - plain.At(Posed(5))).cwiseAbs().maxCoeff(), 1e-4f) << "the pose must matter";
}

TEST(TrainedNet, EveryWeightLearns) {
  TrainedNet net = Surface().Net(3);
  Adam adam;
  for (auto& [name, value] : net.parameters()) adam.Add(name, value);
  double first = 0, last = 0;
  for (int i = 0; i < 60; ++i) {
    const at::Tensor loss = (net.Forward(Posed(i % 5)) - 0.03).pow(2).mean();
    (i == 0 ? first : last) = loss.item<double>();
    adam.ClearGradients();
    loss.backward();
    if (i == 5) {
      for (const auto& [name, value] : net.parameters()) EXPECT_GT(value.grad().abs().max().item<float>(), 0) << name;
    }
    adam.Step(1e-2);
  }
  EXPECT_LT(last, 0.05 * first);
}

TEST(TrainedNet, HasTheGradientOfItsDifferences) {
  TrainedNet net = Surface().Net(3);
  torch::manual_seed(1);
  Shake(&net, 0.1);
  const at::Tensor weights = at::randn({Small().vertices.cols(), 3});
  const auto value = [&] { return (net.Forward(Posed(4)) * weights).to(at::kDouble).sum(); };
  value().backward();
  at::Tensor head;
  for (auto& [name, tensor] : net.parameters()) {
    if (name == "head.bias") head = tensor;
  }
  const double slope = head.grad()[1].item<double>();
  const torch::NoGradGuard no_gradients;
  constexpr double kStep = 1e-2;
  head[1] += kStep;
  const double above = value().item<double>();
  head[1] -= 2 * kStep;
  const double below = value().item<double>();
  EXPECT_NEAR((above - below) / (2 * kStep), slope, 1e-3 * std::abs(slope));
}

/// Offsets (V, 3) that grow smoothly along the body.
at::Tensor SmoothField() {
  at::Tensor field = at::empty({Small().vertices.cols(), 3});
  for (Eigen::Index v = 0; v < Small().vertices.cols(); ++v) {
    const Eigen::Vector3f x = Small().vertices.col(v);
    field[v][0] = std::sin(3 * x[2]), field[v][1] = std::cos(4 * x[0]), field[v][2] = std::sin(2 * x[0] + x[2]);
  }
  return field;
}

// Small steps: over tenths of a pixel other edges become the outline, and differences are off by several per cent. The
// gradient by itself is compared in double precision in tests/body/soft_silhouette_test.cc.
TEST(SilhouetteOfOffsets, HasTheGradientOfItsDifferences) {
  const SwellingTake take(15, 0.15);
  const body::TakeOutlines outlines = TakeOutlinesOf(take.person, take.steps, {}, OneThread());
  const SilhouetteViews views{&outlines, &outlines.steps[2], {0, 2}, {1e-3}};
  const at::Tensor field = SmoothField(), at_rest = (0.004 * field).requires_grad_();
  SilhouetteOfOffsets(at_rest, views).backward();
  const double slope = (at_rest.grad() * field).sum().item<double>();
  const auto at = [&](double step) { return SilhouetteOfOffsets(((0.004 + step) * field).detach(), views).item<double>(); };
  constexpr double kStep = 3e-5;  // metres; float32 carries it
  EXPECT_NEAR((at(kStep) - at(-kStep)) / (2 * kStep), slope, 0.02 * std::abs(slope));
}

double MeanOf(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double LossOf(const body::TakeOutlines& take, const std::vector<int>& steps,
              const std::shared_ptr<const body::MovingOffsets>& network) {
  if (!network) return MeanOf(StepLosses(take, steps, std::nullopt, OneThread()));
  const body::TrainedOffsets offsets{std::nullopt, network};
  const auto at = [&](const body::ArticulatedPose& pose) { return offsets.At(take.body, pose); };
  return MeanOf(StepLosses(take, steps, at, OneThread()));
}

NetworkTrainingOptions SmallOptions() {
  NetworkTrainingOptions options;
  options.net = {4, 8, 8, 16}, options.steps = 150, options.views_per_step = 3, options.learning_rate = 3e-3;
  return options;
}

TEST(NetworkTraining, ExplainsOneTimeStep) {
  const SwellingTake take(15, 0.2);
  const body::TakeOutlines outlines = TakeOutlinesOf(take.person, take.steps, {}, OneThread());
  const auto network = NetworkTraining(outlines, SmallOptions(), OneThread()).Train({2});
  EXPECT_LT(LossOf(outlines, {2}, network), 0.5 * LossOf(outlines, {2}, nullptr));
}

TEST(NetworkTraining, LearnsWhatMovesWithThePose) {
  constexpr double kPerRadianM = 0.25;
  const SwellingTake take(18, kPerRadianM);
  const body::TakeOutlines outlines = TakeOutlinesOf(take.person, take.steps, {}, OneThread());
  NetworkTrainingOptions options = SmallOptions();
  options.steps = 200;
  std::vector<int> seen, others;
  for (int i = 0; i < 18; ++i) (i % 5 == 2 ? others : seen).push_back(i);
  const auto network = NetworkTraining(outlines, options, OneThread()).Train(seen);
  EXPECT_LT(LossOf(outlines, seen, network), 0.9 * LossOf(outlines, seen, nullptr));
  EXPECT_LT(LossOf(outlines, others, network), 0.8 * LossOf(outlines, others, nullptr)) << "poses between those seen";
  float error = 0, truth = 0;
  for (const int i : others) {
    const Eigen::Matrix3Xf swell = body::testing::Swell(SwingingPose(i), kPerRadianM);
    error += (network->At(Posed(i)) - swell).squaredNorm(), truth += swell.squaredNorm();
  }
  EXPECT_LT(error, 0.5f * truth);  // outlines show a part of it
}

TEST(NetworkTraining, IsDecidedByItsSeed) {
  const SwellingTake take(15, 0.2);
  const body::TakeOutlines outlines = TakeOutlinesOf(take.person, take.steps, {}, OneThread());
  NetworkTrainingOptions options = SmallOptions();
  options.steps = 10;
  const Eigen::Matrix3Xf once = NetworkTraining(outlines, options, OneThread()).Train({1, 2, 3})->At(Posed(4));
  EXPECT_EQ(NetworkTraining(outlines, options, OneThread()).Train({1, 2, 3})->At(Posed(4)), once);
  options.seed = 2;
  EXPECT_NE(NetworkTraining(outlines, options, OneThread()).Train({1, 2, 3})->At(Posed(4)), once);
}

TEST(FitMovingSurface, GivesTheNetworkToTheBody) {
  const SwellingTake take(18, 0.3);
  body::PersonBody moving = take.person;
  NetworkTrainingOptions options = SmallOptions();
  options.steps = 20;
  const auto make = [&](const body::TakeOutlines& outlines) { return NetworkTrainer(outlines, options, OneThread()); };
  const body::DynamicFit fit = FitMovingSurface(take.steps, {}, body::DynamicMode::kNetwork, make, OneThread(), &moving);
  ASSERT_TRUE(fit.offsets) << fit.reason;
  ASSERT_EQ(fit.candidates.size(), 1u);
  EXPECT_EQ(fit.candidates[0].gains.size(), 5u);
  const body::ArticulatedPose& seen = take.person.seen.at(12);
  const body::BodyPose pose = ToBodyPose(moving.body, seen);
  const Eigen::Matrix3Xf offsets = fit.offsets->At(take.person.body, seen);
  EXPECT_GT(offsets.cwiseAbs().maxCoeff(), 1e-4f);
  const Eigen::Matrix3Xf expected = SkinVertices(WithOffsets(take.person.body, offsets), pose);
  EXPECT_LT((SkinVertices(moving.body, pose) - expected).cwiseAbs().maxCoeff(), 1e-6f);
}

}  // namespace
}  // namespace mvstudio::avatar
