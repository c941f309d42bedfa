// Bone maps, texture sampling and losses.
#include <ATen/ATen.h>

#include <cmath>
#include <limits>

#include "avatar/maps/bones.h"
#include "avatar/maps/texture.h"
#include "avatar/train/losses.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct Pose {
  at::Tensor px = at::full({1, 19, 2}, -1000.0, at::kFloat);
  at::Tensor depth = at::zeros({1, 19}, at::kFloat);
  at::Tensor valid = at::zeros({1, 19}, at::kBool);
  void Set(int64_t joint, double x, double y, double z) {
    px[0][joint][0] = x, px[0][joint][1] = y, depth[0][joint] = z, valid[0][joint] = true;
  }
};

TEST(Bones, ValueFollowsTheClosedFormOfAHorizontalCapsule) {
  Pose pose;
  pose.Set(0, 10, 20, 1.0), pose.Set(1, 30, 20, 3.0);  // bone 0
  const DepthRange range = {0, 4};
  const at::Tensor map = RasterizeBones(pose.px, pose.depth, pose.valid, 40, 48, 2.0, range)[0][0];
  for (int64_t y = 0; y < 40; ++y) {
    for (int64_t x = 0; x < 48; ++x) {
      const double t = std::clamp((x - 10.0) / 20, 0.0, 1.0);
      const double distance = std::hypot(x - (10 + 20 * t), y - 20.0);
      const double cover = std::clamp(3 - distance, 0.0, 1.0), value = -0.8 + 1.8 * (1 + 2 * t) / 4;
      EXPECT_NEAR(map[y][x].item<double>(), -1 + cover * (value + 1), 2e-6) << x << " " << y;
    }
  }
}

TEST(Bones, BothImplementationsAgree) {
  Rng random(3);
  at::Tensor px = at::zeros({3, 19, 2}, at::kFloat), depth = at::zeros({3, 19}, at::kFloat),
             valid = at::ones({3, 19}, at::kBool);
  for (int64_t i = 0; i < 3; ++i) {
    for (int64_t j = 0; j < 19; ++j) {
      px[i][j][0] = random.Uniform(-30, 94), px[i][j][1] = random.Uniform(-30, 94), depth[i][j] = random.Uniform(-2, 2);
      valid[i][j] = random.Uniform() < 0.85;
    }
  }
  px[1][4] = px[1][3];  // a bone of no length
  valid[2][7] = false, px[2][7][0] = kNan;
  const DepthRange range = {-1, 1};
  for (const double half_width : {1.0, 4.0}) {
    const at::Tensor fast = RasterizeBones(px, depth, valid, 64, 56, half_width, range);
    const at::Tensor plain = RasterizeMapsTensor(LayoutOf(kNumBones).maps, px, depth, valid, 64, 56, half_width, range);
    EXPECT_LT((fast - plain).abs().max().item<double>(), 2e-4);
    EXPECT_TRUE(at::isfinite(plain).all().item<bool>());
    EXPECT_GE(fast.min().item<double>(), -1.0);
    EXPECT_LE(fast.max().item<double>(), 1.0 + 1e-6);
  }
}

TEST(Bones, JointOutsideTheImageKeepsItsBoneAndAnInvalidOneDropsIt) {
  Pose pose;
  pose.Set(0, -15, 8, 1), pose.Set(1, 8, 8, 1);
  const at::Tensor kept = RasterizeBones(pose.px, pose.depth, pose.valid, 16, 16, 1.0, {0.5, 2})[0][0];
  EXPECT_GT(kept[8][2].item<double>(), -1.0);
  pose.valid[0][0] = false;
  EXPECT_EQ(RasterizeBones(pose.px, pose.depth, pose.valid, 16, 16, 1.0, {0.5, 2}).max().item<double>(), -1.0);
}

TEST(Bones, NearestDepthIsAboveTheBackground) {
  Pose pose;
  pose.Set(0, 4, 8, -100), pose.Set(1, 12, 8, -100);
  EXPECT_NEAR(RasterizeBones(pose.px, pose.depth, pose.valid, 16, 16, 1.0, {0, 1})[0][0][8][8].item<double>(), -0.8, 1e-6);
}

TEST(Bones, ValidJointThatIsNotFiniteIsRefused) {
  Pose pose;
  pose.Set(0, kNan, 8, 1), pose.Set(1, 12, 8, 1);
  EXPECT_THROW(RasterizeBones(pose.px, pose.depth, pose.valid, 16, 16, 1.0, {0, 1}), ContractViolation);
}

TEST(Bones, DepthRangeIsRobust) {
  at::Tensor depth = at::linspace(2, 4, 19 * 50, at::kFloat).view({50, 19}).contiguous();
  depth[3][3] = 1e6;  // one joint gone astray
  const DepthRange range = ChooseDepthRange(depth, at::ones({50, 19}, at::kBool));
  EXPECT_NEAR(range.near_m, 1.82, 0.03);
  EXPECT_NEAR(range.far_m, 4.18, 0.03);
  EXPECT_THROW(ChooseDepthRange(depth, at::zeros({50, 19}, at::kBool)), ContractViolation);
}

TEST(Bones, RelativeDepthIsMeasuredFromTheBodyCentre) {
  at::Tensor joints = at::ones({2, 19, 3}, at::kFloat);
  joints[0][2][2] = 3.0;
  at::Tensor valid = at::ones({2, 19}, at::kBool);
  valid[1][2] = false;
  const at::Tensor depth = BoneDepth(joints, valid, true);
  EXPECT_FLOAT_EQ(depth[0][5].item<float>(), -2.0f);
  EXPECT_FLOAT_EQ(depth[1][5].item<float>(), 0.0f);
}

TEST(Bones, SlopeIsTheShareOfTheBoneThatPointsAway) {
  Pose pose;
  pose.Set(0, 4, 8, 0), pose.Set(1, 12, 8, 0);
  at::Tensor x_in_cam = at::zeros({1, 19, 3}, at::kFloat);
  x_in_cam[0][1][0] = 0.3, x_in_cam[0][1][2] = -0.4;  // towards the camera: -4 / 5
  const at::Tensor maps = RasterizeSlopes(pose.px, x_in_cam, pose.valid, 16, 16, 1.0);
  EXPECT_EQ(maps.sizes(), at::IntArrayRef({1, 18, 16, 16}));
  EXPECT_NEAR(maps[0][0][8][8].item<double>(), -0.8, 1e-6);
  EXPECT_EQ(maps[0][0][0][0].item<double>(), 0.0);
  EXPECT_EQ(maps.slice(1, 1).abs().max().item<double>(), 0.0);
}

/// One part everywhere at one coordinate.
at::Tensor SampleAt(const at::Tensor& textures, int64_t part, double u, double v, double background_prob = 0) {
  at::Tensor prob = at::zeros({1, 25, 1, 1}), uv = at::zeros({1, 48, 1, 1});
  prob[0][part] = 1 - background_prob, prob[0][0] = background_prob;
  uv[0][part - 1] = u, uv[0][24 + part - 1] = v;
  return SampleTextures(textures, prob, uv, at::tensor({0.1f, 0.2f, 0.3f})).flatten();
}

TEST(Textures, SamplingIsExactOnALinearTextureAndRepeatsTheBorder) {
  const int64_t size = 8;
  at::Tensor textures = at::zeros({24, 3, size, size});
  textures[6][0] = at::linspace(-1, 1, size).view({1, size}).expand({size, size});  // part 7, red rises with u
  textures[6][1] = at::linspace(-1, 1, size).view({size, 1}).expand({size, size});  // green with v
  const auto expected = [&](double u) {
    const double texel = std::clamp(((u + 1) * size - 1) / 2, 0.0, size - 1.0);
    return 0.5 * (-1 + 2 * texel / (size - 1)) + 0.5;
  };
  for (const double u : {-1.0, -0.95, -0.4, 0.0, 0.31, 0.93, 1.0}) {
    const at::Tensor rgb = SampleAt(textures, 7, u, -u);
    EXPECT_NEAR(rgb[0].item<double>(), expected(u), 1e-6);
    EXPECT_NEAR(rgb[1].item<double>(), expected(-u), 1e-6);
    EXPECT_NEAR(rgb[2].item<double>(), 0.5, 1e-6);
  }
  EXPECT_NEAR(SampleAt(textures, 7, 1, 1, 0.25)[2].item<double>(), 0.75 * 0.5 + 0.25 * 0.3, 1e-6);
}

TEST(Textures, GradientOfTheTexelsSumsToTheProbability) {
  at::Tensor textures = at::zeros({24, 3, 4, 4}).requires_grad_();
  at::Tensor prob = at::softmax(at::randn({2, 25, 6, 5}), 1), uv = at::tanh(at::randn({2, 48, 6, 5}));
  SampleTextures(textures, prob, uv, at::zeros({3})).sum().backward();
  const at::Tensor per_part = textures.grad().sum({1, 2, 3}), expected = 0.5 * 3 * prob.slice(1, 1).sum({0, 2, 3});
  EXPECT_LT((per_part - expected).abs().max().item<double>(), 1e-4);
}

TEST(Textures, CoordinateThatIsNotFiniteIsRefused) {
  EXPECT_THROW(SampleAt(at::zeros({24, 3, 4, 4}), 3, kNan, 0), ContractViolation);
}

TEST(Textures, AveragingRecoversColoursAndFillsHoles) {
  const int64_t size = 8, count = 4000;
  Rng random(5);
  at::Tensor part = at::full({count}, 2, at::kLong), uv = at::zeros({count, 2}), rgb = at::zeros({count, 3});
  for (int64_t i = 0; i < count; ++i) {
    const double u = random.Uniform(-1, 0), v = random.Uniform(-1, 1);  // the left half of part 2
    uv[i][0] = u, uv[i][1] = v, rgb[i][0] = 0.5, rgb[i][1] = 0.8 * v, rgb[i][2] = -0.25;
  }
  TextureSums sums = ZeroTextureSums(size);
  AddPixels(sums, part, uv, rgb, at::ones({count}));
  EXPECT_NEAR(sums.weight.sum().item<double>(), count, 1e-1);
  const at::Tensor filled = FillTextures(sums);
  EXPECT_NEAR(filled[1][0][3][7].item<double>(), 0.5, 1e-4);     // never seen: from the neighbours
  EXPECT_NEAR(filled[20][2][1][1].item<double>(), -0.25, 1e-4);  // a part never seen: the mean colour
  const double centre_v = (2 * 4 + 1) / 8.0 - 1;
  EXPECT_NEAR(filled[1][1][4][1].item<double>(), 0.8 * centre_v, 0.03);
  for (const int64_t y : {0, 1, 6, 7}) {  // rows go on where nothing was seen: in the chart itself and on the body's other side
    const double v = (2 * static_cast<double>(y) + 1) / 8 - 1;
    EXPECT_NEAR(filled[1][1][y][7].item<double>(), 0.8 * v, 0.2) << y;
    EXPECT_NEAR(filled[0][1][y][3].item<double>(), 0.8 * v, 0.25) << y;
  }
  EXPECT_TRUE(at::isfinite(filled).all().item<bool>());
}

TEST(Losses, MaskGradientDoesNotVanishAtExtremeLogits) {
  at::Tensor logits = at::zeros({1, 25, 1, 1}, at::kFloat);
  logits[0][3] = 120;  // certain of part 3 where the mask says background
  logits.requires_grad_();
  const at::Tensor loss = MaskLoss(logits, at::zeros({1, 1, 1}));
  loss.backward();
  EXPECT_NEAR(loss.item<double>(), 120, 1e-4);
  EXPECT_NEAR(logits.grad()[0][0].item<double>(), -1, 1e-5);
  EXPECT_NEAR(logits.grad()[0][3].item<double>(), 1, 1e-5);
  at::Tensor one = at::full({1, 1, 1, 1}, 120.0, at::kFloat).requires_grad_();
  MaskLoss(one, at::zeros({1, 1, 1})).backward();
  EXPECT_NEAR(one.grad().item<double>(), 1, 1e-5);
}

TEST(Losses, MaskLossIsTheEntropyOfAFairGuess) {
  EXPECT_NEAR(MaskLoss(at::zeros({2, 25, 3, 3}), at::zeros({2, 3, 3})).item<double>(), std::log(25.0), 1e-5);
  EXPECT_NEAR(MaskLoss(at::zeros({2, 25, 3, 3}), at::ones({2, 3, 3})).item<double>(), std::log(25.0 / 24), 1e-5);
}

TEST(Losses, VanishForEqualImagesAndCountThePersonMore) {
  const at::Tensor a = at::rand({2, 3, 16, 16}), mask = at::zeros({2, 16, 16});
  mask.slice(1, 0, 8).fill_(1);
  EXPECT_NEAR(WeightedL1(a, a, mask, 3).item<double>(), 0, 1e-7);
  EXPECT_NEAR(SsimLoss(a, a, mask, 3).item<double>(), 0, 1e-5);
  const at::Tensor weights = PixelWeights(mask, 3);
  EXPECT_NEAR(weights.sum().item<double>(), 1, 1e-6);
  EXPECT_NEAR(GradientLoss(a, a, weights).item<double>(), 0, 1e-7);
  EXPECT_NEAR(GradientLoss(a, a + 0.3, weights).item<double>(), 0, 1e-6);
  at::Tensor on = a.clone(), beside = a.clone();
  on.slice(2, 2, 6) += 0.1, beside.slice(2, 10, 14) += 0.1;
  const double ratio = GradientLoss(a, on, weights).item<double>() / GradientLoss(a, beside, weights).item<double>();
  EXPECT_GT(ratio, 2) << "3, but for coarse differences across the outline";
  EXPECT_LT(ratio, 3);
  at::Tensor b = a.clone();
  b.slice(2, 0, 8) += 0.1;  // off by 0.1 on the person alone
  EXPECT_NEAR(WeightedL1(a, b, mask, 3).item<double>(), 0.1 * 3 / 4, 1e-5);
}

TEST(Losses, UvCountsTheLabelledPartOnly) {
  at::Tensor uv = at::full({1, 48, 2, 2}, 9.0), target = at::zeros({1, 2, 2, 2}), part = at::zeros({1, 2, 2}, at::kLong);
  part[0][0][0] = 5;
  uv[0][4][0][0] = 0.5, uv[0][28][0][0] = -0.25;
  EXPECT_NEAR(UvLoss(uv, target, part).item<double>(), 0.375, 1e-6);
  EXPECT_EQ(UvLoss(uv, target, at::zeros_like(part)).item<double>(), 0.0);
}

}  // namespace
}  // namespace mvstudio::avatar
