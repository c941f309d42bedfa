#include "avatar/scores/image_scores.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include "core/check.h"
#include "core/parallel.h"

namespace mvstudio::avatar {

at::Tensor EightBit(const at::Tensor& images) { return (images.to(at::kDouble).clamp(0, 1) * 255).round() / 255; }

metrics::PlanarImage ToPlanarImage(const at::Tensor& image) {
  MVS_CHECK(image.dim() == 3, "an image of sizes " << image.sizes());
  const at::Tensor samples = image.detach().to(at::kCPU, at::kDouble).contiguous();
  const double* first = samples.data_ptr<double>();
  return {static_cast<int>(image.size(2)),
          static_cast<int>(image.size(1)),
          static_cast<int>(image.size(0)),
          1,
          {first, first + samples.numel()}};
}

metrics::Mask ToMask(const at::Tensor& mask) {
  MVS_CHECK(mask.dim() == 2, "a mask of sizes " << mask.sizes());
  const at::Tensor inside = mask.detach().to(at::kCPU).ge(0.5).to(at::kByte).contiguous();
  const uint8_t* first = inside.data_ptr<uint8_t>();
  return {first, first + inside.numel()};
}

std::vector<metrics::ImageScore> ScoreImages(const at::Tensor& truth, const at::Tensor& true_mask, const at::Tensor& image,
                                             const at::Tensor& mask) {
  MVS_CHECK(truth.dim() == 4 && truth.sizes() == image.sizes(),
            "images of sizes " << truth.sizes() << " and " << image.sizes());
  MVS_CHECK(true_mask.dim() == 3 && true_mask.sizes() == mask.sizes() && true_mask.size(0) == truth.size(0) &&
                true_mask.size(1) == truth.size(2) && true_mask.size(2) == truth.size(3),
            "masks of sizes " << true_mask.sizes() << " and " << mask.sizes() << " for images of " << truth.sizes());
  std::vector<metrics::ImageScore> scores(truth.size(0));
  ParallelFor(truth.size(0), at::get_num_threads(), [&](int64_t i) {
    scores[i] =
        metrics::ScoreImage(ToPlanarImage(truth[i]), ToMask(true_mask[i].ne(0)), ToPlanarImage(image[i]), ToMask(mask[i]));
  });
  return scores;
}

}  // namespace mvstudio::avatar
