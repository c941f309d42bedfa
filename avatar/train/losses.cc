#include "avatar/train/losses.h"

#include <ATen/ATen.h>

namespace mvstudio::avatar {
namespace {

/// The mask where a 7x7 window lies inside the image.
at::Tensor Inner(const at::Tensor& mask) { return mask.slice(1, 3, mask.size(1) - 3).slice(2, 3, mask.size(2) - 3); }

at::Tensor Or(const at::Tensor& total, const at::Tensor& own) { return total.defined() ? total : own; }

/// Means over 7x7 windows that lie inside the image.
at::Tensor Box7(const at::Tensor& x) { return at::avg_pool2d(at::avg_pool2d(x, {7, 1}, {1, 1}), {1, 7}, {1, 1}); }

}  // namespace

at::Tensor PixelWeights(const at::Tensor& mask, double foreground_weight, const at::Tensor& total) {
  const at::Tensor weight = 1 + (foreground_weight - 1) * mask.unsqueeze(1);
  return weight / Or(total, weight.sum());
}

at::Tensor WeightedL1(const at::Tensor& a, const at::Tensor& b, const at::Tensor& mask, double foreground_weight,
                      const at::Tensor& total) {
  return ((a - b).abs().mean(1, true) * PixelWeights(mask, foreground_weight, total)).sum();
}

at::Tensor SsimLoss(const at::Tensor& a, const at::Tensor& b, const at::Tensor& mask, double foreground_weight,
                    const at::Tensor& total) {
  constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;
  const std::vector<at::Tensor> m = Box7(at::cat({a, b, a * a, b * b, a * b}, 1)).split(3, 1);
  const at::Tensor var_a = m[2] - m[0] * m[0], var_b = m[3] - m[1] * m[1], cov = m[4] - m[0] * m[1];
  const at::Tensor ssim =
      (2 * m[0] * m[1] + kC1) * (2 * cov + kC2) / ((m[0] * m[0] + m[1] * m[1] + kC1) * (var_a + var_b + kC2));
  return ((1 - ssim).mean(1, true) * PixelWeights(Inner(mask), foreground_weight, total)).sum();
}

at::Tensor PixelTotal(const at::Tensor& mask, double foreground_weight) { return (1 + (foreground_weight - 1) * mask).sum(); }

at::Tensor SsimPixelTotal(const at::Tensor& mask, double foreground_weight) {
  return PixelTotal(Inner(mask), foreground_weight);
}

at::Tensor GradientLoss(const at::Tensor& a, const at::Tensor& b, const at::Tensor& weights) {
  at::Tensor difference = a - b, weight = weights, sum = at::zeros({}, a.options());
  for (int level = 0; level < 3; ++level) {
    if (level > 0) difference = at::avg_pool2d(difference, 2), weight = 4 * at::avg_pool2d(weight, 2);
    for (const int64_t axis : {2, 3}) {
      const int64_t size = weight.size(axis);  // a difference lies between two pixels
      const at::Tensor between = 0.5 * (weight.slice(axis, 1) + weight.slice(axis, 0, size - 1));
      sum = sum + (difference.diff(1, axis).abs().mean(1, true) * between).sum();
    }
  }
  return sum / 3;
}

at::Tensor MaskLoss(const at::Tensor& logits, const at::Tensor& mask) {
  if (logits.size(1) == 1) {
    const at::Tensor x = logits.squeeze(1);
    return -(mask * at::log_sigmoid(x) + (1 - mask) * at::log_sigmoid(-x)).mean();
  }
  const at::Tensor all = at::logsumexp(logits, 1);
  const at::Tensor log_background = logits.select(1, 0) - all;
  const at::Tensor log_person = at::logsumexp(logits.slice(1, 1), 1) - all;
  return -(mask * log_person + (1 - mask) * log_background).mean();
}

at::Tensor PartLoss(const at::Tensor& logits, const at::Tensor& part, const at::Tensor& person_total,
                    const at::Tensor& rest_total) {
  const at::Tensor cost = at::nll_loss_nd(at::log_softmax(logits, 1), part, {}, at::Reduction::None);
  const at::Tensor person = (part > 0).to(cost.dtype()), rest = 1 - person;
  return 0.5 * ((cost * person).sum() / Or(person_total, person.sum()).clamp_min(1) +
                (cost * rest).sum() / Or(rest_total, rest.sum()).clamp_min(1));
}

at::Tensor UvLoss(const at::Tensor& uv, const at::Tensor& target, const at::Tensor& part, const at::Tensor& total) {
  const at::Tensor channel = (part - 1).clamp_min(0).unsqueeze(1);  // (B, 1, H, W)
  const at::Tensor chosen = at::cat({uv.slice(1, 0, 24).gather(1, channel), uv.slice(1, 24, 48).gather(1, channel)}, 1);
  const at::Tensor labelled = (part > 0).to(uv.dtype()).unsqueeze(1);
  return ((chosen - target).abs() * labelled).sum() / (2 * Or(total, labelled.sum())).clamp_min(1);
}

at::Tensor SaturationLoss(const at::Tensor& x, double limit) { return at::relu(x.abs() - limit).square().mean(); }

}  // namespace mvstudio::avatar
