#include "avatar/scores/image_scores.h"

#include <ATen/ATen.h>

#include <cmath>

#include "avatar/scores/set_distance.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

at::Tensor RandomImages(int64_t n, int64_t size, uint64_t seed) {
  Rng rng(seed);
  at::Tensor x = at::empty({n, 3, size, size}, at::kDouble);
  for (int64_t i = 0; i < x.numel(); ++i) x.data_ptr<double>()[i] = rng.Uniform();
  return x;
}

double Ssim(const at::Tensor& a, const at::Tensor& b) { return metrics::Ssim(ToPlanarImage(a[0]), ToPlanarImage(b[0])).value; }
double PsnrDb(const at::Tensor& a, const at::Tensor& b) {
  return metrics::PsnrDb(ToPlanarImage(a[0]), ToPlanarImage(b[0])).value;
}

TEST(ScoreImages, TheBoxIsTheMaskPlusFivePercent) {
  const at::Tensor a = RandomImages(1, 64, 1), b = RandomImages(1, 64, 2);
  at::Tensor mask = at::zeros({1, 64, 64}, at::kByte);
  mask.slice(1, 10, 50).slice(2, 20, 40).fill_(255);  // 20 wide, 40 high: margin 2
  const metrics::ImageScore score = ScoreImages(a, mask, b, mask.to(at::kDouble) / 255)[0];
  const auto box = [](const at::Tensor& x) { return x.slice(2, 8, 52).slice(3, 18, 42).contiguous(); };
  EXPECT_NEAR(score.bbox.ssim, Ssim(box(a), box(b)), 1e-13);
  EXPECT_NEAR(score.bbox.ssim_luma,
              metrics::Ssim(metrics::Luma(ToPlanarImage(box(a)[0])), metrics::Luma(ToPlanarImage(box(b)[0]))).value, 1e-13);
  EXPECT_NEAR(score.bbox.psnr_db, PsnrDb(box(a), box(b)), 1e-12);
  EXPECT_NEAR(score.full.ssim, Ssim(a, b), 1e-13);
  const auto inside = [](const at::Tensor& x) { return x.slice(2, 10, 50).slice(3, 20, 40).contiguous(); };
  EXPECT_NEAR(score.masked.psnr_db, PsnrDb(inside(a), inside(b)), 1e-12);
  const metrics::SsimMap map = metrics::ComputeSsimMap(ToPlanarImage(a[0]), ToPlanarImage(b[0]));
  EXPECT_EQ(score.masked.ssim, metrics::Mean(map, ToMask(mask[0])).value);
  const at::Tensor inner = at::tensor(map.values, at::kDouble).view({54, 54}).slice(0, 5, 45).slice(1, 15, 35);
  EXPECT_NEAR(score.masked.ssim, inner.mean().item<double>(), 1e-13);
  EXPECT_EQ(score.boundary_f, 1.0);
  EXPECT_EQ(score.mask_iou, 1.0);
}

TEST(ScoreImages, SmallAndCornerMasksStillFillAWindow) {
  const at::Tensor a = RandomImages(1, 32, 3), b = RandomImages(1, 32, 4);
  at::Tensor mask = at::zeros({1, 32, 32}, at::kByte);
  mask[0][31][0] = 255;
  const metrics::ImageScore score = ScoreImages(a, mask, b, mask.to(at::kDouble))[0];
  const auto box = [](const at::Tensor& x) { return x.slice(2, 21, 32).slice(3, 0, 11).contiguous(); };
  EXPECT_NEAR(score.bbox.ssim, Ssim(box(a), box(b)), 1e-13);
  EXPECT_THROW(ScoreImages(a, at::zeros_like(mask), b, mask), ContractViolation);
  EXPECT_THROW(ScoreImages(a, mask, b, mask.slice(1, 0, 20)), ContractViolation);
}

TEST(ScoreImages, MeansAndEqualImages) {
  const at::Tensor a = RandomImages(2, 32, 5);
  at::Tensor b = a.clone();
  b[1] = (b[1] - 0.5) * 0.9 + 0.5;
  const at::Tensor mask = at::ones({2, 32, 32}, at::kByte);
  const auto scores = ScoreImages(a, mask, b, mask.to(at::kDouble));
  const metrics::MeanScore mean = metrics::Mean(scores);
  EXPECT_EQ(mean.n, 2);
  EXPECT_EQ(mean.psnr_infinite, 1);
  EXPECT_NEAR(mean.bbox.psnr_db, scores[1].bbox.psnr_db, 1e-12);
  EXPECT_NEAR(mean.bbox.ssim, (1 + scores[1].bbox.ssim) / 2, 1e-12);
  EXPECT_THROW(metrics::Mean(std::vector<metrics::ImageScore>()), ContractViolation);
}

TEST(EightBit, IsWhatAFileGivesBack) {
  const at::Tensor x = at::tensor({0.0, 0.5, 0.001, 1.2, -3.0}, at::kFloat);
  const at::Tensor y = EightBit(x) * 255;
  const double expected[] = {0, 128, 0, 255, 0};
  for (int i = 0; i < 5; ++i) EXPECT_NEAR(y[i].item<double>(), expected[i], 1e-9);
}

TEST(BlockBootstrap, CoversTheMeanOfIndependentFrames) {
  Rng rng(6);
  int covered = 0;
  const int trials = 200;
  for (int t = 0; t < trials; ++t) {
    std::vector<double> values;
    std::vector<int64_t> frames;
    for (int f = 0; f < 64; ++f) {
      const double value = rng.Normal();
      for (int camera = 0; camera < 3; ++camera) values.push_back(value), frames.push_back(f);  // cameras add nothing new
    }
    const metrics::Interval interval = metrics::BlockBootstrap(values, frames, t);
    EXPECT_LT(interval.low, interval.high);
    covered += interval.low <= 0 && 0 <= interval.high;
  }
  EXPECT_NEAR(covered / static_cast<double>(trials), 0.95, 0.09);
  const metrics::Interval one = metrics::BlockBootstrap({0.5, 0.7}, {3, 3}, 1);
  EXPECT_TRUE(std::isnan(one.low) && std::isnan(one.high)) << "two cameras of one frame show no spread of frames";
}

TEST(CompareSets, IsZeroForEqualSetsAndNeedsFour) {
  const at::Tensor x = RandomImages(6, 32, 7);
  const auto distance = CompareSets(x, x, *GaborNet(), 1);
  ASSERT_TRUE(distance.has_value());
  EXPECT_LE(distance->fd, 1e-10);
  EXPECT_GT(distance->floor, distance->fd);
  EXPECT_EQ(distance->n, 6);
  EXPECT_EQ(distance->d, 240);
  EXPECT_EQ(distance->features, "gabor-stats-v1");
  EXPECT_FALSE(CompareSets(x.slice(0, 0, 3), x.slice(0, 0, 3), *GaborNet(), 1).has_value());
  EXPECT_FALSE(CompareSets(x.slice(2, 0, 20), x.slice(2, 0, 20), *GaborNet(), 1).has_value());
}

}  // namespace
}  // namespace mvstudio::avatar
