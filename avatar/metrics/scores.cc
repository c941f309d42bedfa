#include "avatar/metrics/scores.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/check.h"
#include "core/random.h"

namespace mvstudio::metrics {
namespace {

constexpr double kBoxMargin = 0.05;

double Value(const Score& score, const char* what) {
  MVS_CHECK(score.status == Status::kOk, what << " has no value: " << ToString(score.status));
  return score.value;
}

/// The maps of both conventions, made once for all regions.
struct Maps {
  SsimMap rgb, luma, skimage;
};

Maps MakeMaps(const PlanarImage& truth, const PlanarImage& image) {
  return {ComputeSsimMap(truth, image), ComputeSsimMap(Luma(truth), Luma(image)),
          ComputeSsimMap(truth, image, SsimWindow::kUniform7)};
}

/// `region`: a box or a mask.
template <class Region>
RegionScore ScoreRegion(const Maps& maps, const PlanarImage& truth, const PlanarImage& image, const Region& region) {
  return {Value(Mean(maps.rgb, region), "SSIM"), Value(Mean(maps.luma, region), "SSIM of luma"),
          Value(Mean(maps.skimage, region), "SSIM by scikit-image's default"), Value(PsnrDb(truth, image, region), "PSNR")};
}

/// `Pixels`: PlanarImage or Image.
template <class Pixels>
RegionScore ScoreWholeOf(const Pixels& truth, const Pixels& image) {
  return {Value(Ssim(truth, image), "SSIM"), Value(SsimOfLuma(truth, image), "SSIM of luma"),
          Value(Ssim(truth, image, SsimWindow::kUniform7), "SSIM by scikit-image's default"),
          Value(PsnrDb(truth, image), "PSNR")};
}

/// A mask at the image's border may hold no window: then the windows of its box.
double WindowsOf(const SsimMap& map, const Mask& mask, const Box& box) {
  const Score score = Mean(map, mask);
  return score.status == Status::kNothingLeft ? Value(Mean(map, box), "SSIM") : Value(score, "SSIM");
}

}  // namespace

RegionScore ScoreWhole(const PlanarImage& truth, const PlanarImage& image) { return ScoreWholeOf(truth, image); }

RegionScore ScoreWhole(const Image& truth, const Image& image) { return ScoreWholeOf(truth, image); }

ImageScore ScoreImage(const PlanarImage& truth, const Mask& true_mask, const PlanarImage& image, const Mask& mask) {
  const int width = truth.width, height = truth.height;
  const Box box = MaskBox(true_mask, width, height, kBoxMargin, SsimWindowSize(SsimWindow::kWang2004));
  MVS_CHECK(box.x1 > box.x0, "a true mask is empty");
  const Maps maps = MakeMaps(truth, image);
  ImageScore score;
  score.bbox = ScoreRegion(maps, truth, image, box);
  score.full = ScoreRegion(maps, truth, image, Box{0, 0, width, height});
  score.masked = {WindowsOf(maps.rgb, true_mask, box), WindowsOf(maps.luma, true_mask, box),
                  WindowsOf(maps.skimage, true_mask, box), Value(PsnrDb(truth, image, true_mask), "PSNR")};
  score.mask_iou = MaskIou(true_mask, mask);
  score.boundary_f = BoundaryF(true_mask, mask, width, height, BoundaryTolerancePx(width, height));
  return score;
}

RegionScore Mean(const std::vector<RegionScore>& scores, int64_t* psnr_infinite) {
  MVS_CHECK(!scores.empty(), "no images");
  RegionScore mean;
  std::vector<double> psnr;
  const auto n = static_cast<double>(scores.size());
  for (const RegionScore& score : scores) {
    mean.ssim += score.ssim / n, mean.ssim_luma += score.ssim_luma / n, mean.ssim_skimage += score.ssim_skimage / n;
    psnr.push_back(score.psnr_db);
  }
  const PsnrSummary summary = MeanPsnr(psnr);
  mean.psnr_db = summary.mean_db;
  *psnr_infinite = summary.num_infinite;
  return mean;
}

MeanScore Mean(const std::vector<ImageScore>& scores) {
  std::vector<RegionScore> bbox, full, masked;
  MeanScore mean;
  mean.n = static_cast<int64_t>(scores.size());
  for (const ImageScore& score : scores) {
    bbox.push_back(score.bbox), full.push_back(score.full), masked.push_back(score.masked);
    mean.mask_iou += score.mask_iou / static_cast<double>(mean.n);
    mean.boundary_f += score.boundary_f / static_cast<double>(mean.n);
  }
  int64_t ignored = 0;
  mean.bbox = Mean(bbox, &mean.psnr_infinite);
  mean.full = Mean(full, &ignored);
  mean.masked = Mean(masked, &ignored);
  return mean;
}

Interval BlockBootstrap(const std::vector<double>& values, const std::vector<int64_t>& frames, uint64_t seed) {
  MVS_CHECK(!values.empty() && values.size() == frames.size(), values.size() << " values of " << frames.size() << " frames");
  std::map<int64_t, std::pair<double, double>> by_frame;  // sum, count
  for (size_t i = 0; i < values.size(); ++i) by_frame[frames[i]].first += values[i], by_frame[frames[i]].second += 1;
  std::vector<std::pair<double, double>> sums;
  for (const auto& [frame, sum] : by_frame) sums.push_back(sum);
  const auto count = static_cast<int64_t>(sums.size());
  if (count < 2) return {std::nan(""), std::nan("")};
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

}  // namespace mvstudio::metrics
