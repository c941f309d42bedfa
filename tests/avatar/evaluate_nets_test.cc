#include <ATen/ATen.h>

#include "avatar/nets/feature_net.h"
#include "avatar/scores/image_scores.h"
#include "avatar/scores/set_distance.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "tests/avatar/script_nets.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

TEST(FeatureNet, DetectorsGetEightBitsAndGiveFeatures) {
  const TempDir folder;
  SaveDetector(folder / "detector.pt");
  const auto net = LoadTorchScriptNet(folder / "detector.pt");
  EXPECT_EQ(net->name(), "detector.pt");
  EXPECT_EQ(net->sha256(), Sha256File(folder / "detector.pt"));
  const at::Tensor grey = at::full({2, 3, 16, 16}, 0.5, at::kDouble);
  const at::Tensor rows = net->Pooled(grey);
  ASSERT_EQ(rows.sizes(), at::IntArrayRef({2, 15})) << "return_features was passed";
  EXPECT_EQ(rows.min().item<float>(), 128) << "127.5 has become a level of 8 bits";
  EXPECT_EQ(rows.max().item<float>(), 128);
  at::Tensor image = at::full({1, 3, 16, 16}, 0.5f).requires_grad_();
  const at::Tensor smooth = net->Levels(image)[0];
  EXPECT_EQ(smooth.max().item<float>(), 127.5f);
  smooth.sum().backward();
  EXPECT_GT(image.grad().abs().min().item<float>(), 0) << "a loss can use it";
}

TEST(FeatureNet, PlainScriptsTakeFloatsBetweenZeroAndOne) {
  const TempDir folder;
  SaveScript(folder / "plain.pt",
             "def forward(self, x):\n    return torch.conv2d(x, torch.ones([2, 3, 1, 1])) * self.weight\n");
  const auto net = LoadTorchScriptNet(folder / "plain.pt");
  const at::Tensor rows = net->Pooled(at::full({2, 3, 8, 8}, 0.5, at::kDouble));  // double images, float weights
  ASSERT_EQ(rows.sizes(), at::IntArrayRef({2, 2}));
  EXPECT_EQ(rows[0][0].item<float>(), 3);
}

TEST(FeatureNet, WeightsOfAScriptAreFixed) {
  const TempDir folder;
  SaveScript(folder / "plain.pt", "def forward(self, x):\n    return x * self.weight\n");
  EXPECT_FALSE(LoadTorchScriptNet(folder / "plain.pt")->Levels(at::ones({1, 3, 8, 8}))[0].requires_grad());
}

TEST(FeatureNet, WhatIsNoFeatureIsRefused) {
  const TempDir folder;
  const at::Tensor images = at::rand({2, 3, 8, 8});
  const auto message = [&](const std::string& body) {
    SaveScript(folder / "bad.pt", "def forward(self, x):\n    return " + body + "\n");
    return MessageOf<FormatError>([&] { LoadTorchScriptNet(folder / "bad.pt")->Pooled(images); });
  };
  EXPECT_THAT(message("x.mean()"), HasSubstr("bad.pt"));
  EXPECT_THAT(message("x.mean([2, 3])[0:1]"), HasSubstr("one row of features an image"));
  EXPECT_THAT(message("x.mean([2, 3]) / 0"), HasSubstr("NaN or infinity"));
  EXPECT_THAT(message("torch.conv2d(x, torch.ones([2, 7, 1, 1]))"), HasSubstr("cannot take images"));
}

TEST(DistanceName, IsFidForThePublishedWeightsAlone) {
  EXPECT_EQ(DistanceName("inception-2015-12-05.pt", kInceptionSha256), "FID");
  EXPECT_EQ(DistanceName("renamed.pt", kInceptionSha256), "FID");
  EXPECT_EQ(DistanceName("inception-2015-12-05.pt", std::string(64, '0')), "FD (inception-2015-12-05.pt)");
  EXPECT_EQ(DistanceName("gabor-stats-v1", ""), "FD (gabor-stats-v1)");
}

TEST(ImageDistance, TakesMinusOneToOneAndGivesOneNumberAnImage) {
  const TempDir folder;
  SaveImageDistance(folder / "lpips.pt");
  const auto distance = LoadImageDistance(folder / "lpips.pt");
  at::Tensor a = at::zeros({3, 3, 8, 8}, at::kDouble);
  a[1] += 0.5, a[2] += 1;
  const at::Tensor values = (*distance)(a, at::zeros_like(a));
  ASSERT_EQ(values.sizes(), at::IntArrayRef({3}));
  const double expected[] = {0, 1, 4};  // (2 x)^2
  for (int i = 0; i < 3; ++i) EXPECT_DOUBLE_EQ(values[i].item<double>(), expected[i]);
  SaveScript(folder / "sum.pt", "def forward(self, a, b):\n    return (a - b).sum()\n");
  EXPECT_THAT(MessageOf<FormatError>([&] { (*LoadImageDistance(folder / "sum.pt"))(a, a); }), HasSubstr("one number an image"));
  SaveScript(folder / "one.pt", "def forward(self, a):\n    return a\n");
  EXPECT_THAT(MessageOf<FormatError>([&] { (*LoadImageDistance(folder / "one.pt"))(a, a); }), HasSubstr("two sets of images"));
  EXPECT_THROW(LoadImageDistance(folder / "none.pt"), IoError);
}

TEST(CompareSets, GrowsWithDarknessByADetector) {
  const TempDir folder;
  SaveDetector(folder / "detector.pt");
  const auto net = LoadTorchScriptNet(folder / "detector.pt");
  at::manual_seed(1);
  const at::Tensor x = EightBit(at::rand({24, 3, 32, 32}));
  EXPECT_LE(CompareSets(x, x, *net, 1)->fd, 1e-9);
  EXPECT_GT(CompareSets(x, EightBit(x * 0.9), *net, 1)->fd, CompareSets(x, EightBit(x * 0.97), *net, 1)->fd);
  EXPECT_EQ(CompareSets(x, x, *net, 1)->features, "detector.pt");
}

}  // namespace
}  // namespace mvstudio::avatar
