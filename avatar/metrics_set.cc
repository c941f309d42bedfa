#include "avatar/metrics_set.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "avatar/features.h"
#include "core/check.h"
#include "core/random.h"

namespace mvstudio::avatar {
namespace {

struct Box {
  int64_t x0, y0, x1, y1;  // half open
};

// Grows [low, high) to `size` within [0, limit).
void Grow(int64_t& low, int64_t& high, int64_t size, int64_t limit) {
  size = std::min(size, limit);
  if (high - low >= size) return;
  low = std::max<int64_t>(0, std::min(low - (size - (high - low)) / 2, limit - size));
  high = low + size;
}

Box PersonBox(const at::Tensor& mask) {
  const at::Tensor rows = mask.any(1).nonzero(), cols = mask.any(0).nonzero();
  MVS_CHECK(rows.size(0) > 0, "a true mask is empty");
  Box box{cols.min().item<int64_t>(), rows.min().item<int64_t>(), cols.max().item<int64_t>() + 1,
          rows.max().item<int64_t>() + 1};
  const auto margin = static_cast<int64_t>(std::ceil(0.05 * static_cast<double>(std::max(box.x1 - box.x0, box.y1 - box.y0))));
  box = {std::max<int64_t>(0, box.x0 - margin), std::max<int64_t>(0, box.y0 - margin), std::min(mask.size(1), box.x1 + margin),
         std::min(mask.size(0), box.y1 + margin)};
  Grow(box.x0, box.x1, kSsimWindow, mask.size(1));
  Grow(box.y0, box.y1, kSsimWindow, mask.size(0));
  return box;
}

// Mean of an SSIM map (H - 10, W - 10) over the windows that lie inside the box: the SSIM of that box.
double BoxMean(const at::Tensor& map, const Box& box) {
  constexpr int64_t r = kSsimWindow - 1;
  return map.slice(0, box.y0, box.y1 - r).slice(1, box.x0, box.x1 - r).mean().item<double>();
}

// Mean of an SSIM map over the mask, where the map reaches.
double MaskedMean(const at::Tensor& map, const at::Tensor& mask) {
  constexpr int64_t r = kSsimWindow / 2;
  const at::Tensor inside = mask.slice(0, r, mask.size(0) - r).slice(1, r, mask.size(1) - r);
  const double count = inside.sum().item<double>();
  return count > 0 ? (map * inside).sum().item<double>() / count : map.mean().item<double>();
}

PictureScore ScoreOne(const at::Tensor& truth, const at::Tensor& true_mask, const at::Tensor& image, const at::Tensor& mask) {
  const Box box = PersonBox(true_mask);
  const at::Tensor rgb = SsimMap(truth, image)[0], luma = SsimMap(truth, image, SsimChannels::kLuma)[0],
                   inside = true_mask.to(at::kDouble);
  const auto crop = [&](const at::Tensor& x) { return x.slice(2, box.y0, box.y1).slice(3, box.x0, box.x1); };
  PictureScore score;
  score.bbox = {BoxMean(rgb, box), BoxMean(luma, box), PsnrDb(crop(truth), crop(image)).item<double>()};
  score.full = {rgb.mean().item<double>(), luma.mean().item<double>(), PsnrDb(truth, image).item<double>()};
  score.masked = {MaskedMean(rgb, inside), MaskedMean(luma, inside), PsnrDb(truth, image, inside.unsqueeze(0)).item<double>()};
  score.mask_iou = MaskIou(inside.unsqueeze(0), mask.unsqueeze(0)).item<double>();
  return score;
}

RegionScore MeanRegion(const std::vector<PictureScore>& scores, RegionScore PictureScore::*region) {
  RegionScore mean;
  std::vector<double> psnr;
  for (const PictureScore& score : scores) {
    mean.ssim += (score.*region).ssim / static_cast<double>(scores.size());
    mean.ssim_luma += (score.*region).ssim_luma / static_cast<double>(scores.size());
    psnr.push_back((score.*region).psnr_db);
  }
  mean.psnr_db = MeanPsnr(psnr).mean_db;
  return mean;
}

}  // namespace

at::Tensor EightBit(const at::Tensor& pictures) { return (pictures.to(at::kDouble).clamp(0, 1) * 255).round() / 255; }

std::vector<PictureScore> ScorePictures(const at::Tensor& truth, const at::Tensor& true_mask, const at::Tensor& image,
                                        const at::Tensor& mask) {
  MVS_CHECK(truth.dim() == 4 && truth.sizes() == image.sizes(),
            "pictures of sizes " << truth.sizes() << " and " << image.sizes());
  MVS_CHECK(true_mask.dim() == 3 && true_mask.sizes() == mask.sizes() && true_mask.size(0) == truth.size(0) &&
                true_mask.size(1) == truth.size(2) && true_mask.size(2) == truth.size(3),
            "masks of sizes " << true_mask.sizes() << " and " << mask.sizes() << " for pictures of " << truth.sizes());
  std::vector<PictureScore> scores(truth.size(0));
  at::parallel_for(0, truth.size(0), 1,
                   [&](int64_t begin, int64_t end) {  // one picture a thread: what is called inside runs serially
                     for (int64_t i = begin; i < end; ++i) {
                       scores[i] = ScoreOne(truth.slice(0, i, i + 1), true_mask[i].ne(0), image.slice(0, i, i + 1), mask[i]);
                     }
                   });
  return scores;
}

MeanScore Mean(const std::vector<PictureScore>& scores) {
  MVS_CHECK(!scores.empty(), "no pictures");
  MeanScore mean;
  mean.n = static_cast<int64_t>(scores.size());
  mean.bbox = MeanRegion(scores, &PictureScore::bbox);
  mean.full = MeanRegion(scores, &PictureScore::full);
  mean.masked = MeanRegion(scores, &PictureScore::masked);
  for (const PictureScore& score : scores) {
    mean.mask_iou += score.mask_iou / static_cast<double>(mean.n);
    mean.psnr_infinite += std::isinf(score.bbox.psnr_db);
  }
  return mean;
}

Interval BlockBootstrap(const std::vector<double>& values, const std::vector<int64_t>& frames, uint64_t seed) {
  MVS_CHECK(!values.empty() && values.size() == frames.size(), values.size() << " values of " << frames.size() << " frames");
  std::map<int64_t, std::pair<double, double>> by_frame;  // sum, count
  for (size_t i = 0; i < values.size(); ++i) by_frame[frames[i]].first += values[i], by_frame[frames[i]].second += 1;
  std::vector<std::pair<double, double>> sums;
  for (const auto& [frame, sum] : by_frame) sums.push_back(sum);
  const auto count = static_cast<int64_t>(sums.size());
  const auto block = std::max<int64_t>(1, std::llround(std::sqrt(static_cast<double>(count))));
  constexpr int kResamples = 1000;
  Rng rng(seed);
  std::vector<double> means;
  for (int r = 0; r < kResamples; ++r) {
    double sum = 0, number = 0;
    for (int64_t taken = 0; taken < count; taken += block) {
      const int64_t begin = rng.Index(count);
      for (int64_t k = 0; k < std::min(block, count - taken); ++k) {
        sum += sums[(begin + k) % count].first, number += sums[(begin + k) % count].second;
      }
    }
    means.push_back(sum / number);
  }
  std::sort(means.begin(), means.end());
  return {means[kResamples / 40], means[kResamples - 1 - kResamples / 40]};
}

std::optional<SetDistance> CompareSets(const at::Tensor& truth, const at::Tensor& images, uint64_t seed) {
  if (truth.size(0) < 4 || std::min(truth.size(2), truth.size(3)) < kGaborFeatureMinPx) return std::nullopt;
  const at::Tensor x = GaborFeatures(truth), y = GaborFeatures(images);
  return SetDistance{FrechetDistance(x, y), FrechetSplitHalfFloor(x, seed), KernelInceptionDistance(x, y), x.size(0), x.size(1),
                     kGaborFeatureName};
}

}  // namespace mvstudio::avatar
