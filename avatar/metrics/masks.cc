#include "avatar/metrics/masks.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"

namespace mvstudio::metrics {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

Mask Outline(const Mask& mask, int width, int height) {
  Mask outline(mask.size(), 0);
  const auto inside = [&](int x, int y) {
    return x < 0 || y < 0 || x >= width || y >= height || mask[static_cast<size_t>(y) * width + x] != 0;
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool edge = !inside(x - 1, y) || !inside(x + 1, y) || !inside(x, y - 1) || !inside(x, y + 1);
      outline[static_cast<size_t>(y) * width + x] = inside(x, y) && edge;
    }
  }
  return outline;
}

/// Lower envelope of the parabolas (x - i)^2 + f[i], sampled at 0 … n - 1; `stride` between samples.
void Transform(double* f, int n, int stride, std::vector<double>* out, std::vector<int>* roots, std::vector<double>* bounds) {
  const auto at = [&](int i) { return f[static_cast<size_t>(i) * stride]; };
  int last = -1;
  for (int q = 0; q < n; ++q) {
    if (std::isinf(at(q))) continue;
    double cross = -kFar;
    while (last >= 0) {
      const int r = (*roots)[last];
      cross = ((at(q) + double{1} * q * q) - (at(r) + double{1} * r * r)) / (2.0 * (q - r));
      if (cross > (*bounds)[last]) break;
      --last;
    }
    if (last < 0) cross = -kFar;
    (*roots)[++last] = q;
    (*bounds)[last] = cross;
  }
  if (last < 0) return;
  for (int x = 0, k = 0; x < n; ++x) {
    while (k < last && (*bounds)[k + 1] < x) ++k;
    const double d = x - (*roots)[k];
    (*out)[x] = d * d + at((*roots)[k]);
  }
  for (int x = 0; x < n; ++x) f[static_cast<size_t>(x) * stride] = (*out)[x];
}

/// Share of the pixels of `of` within the distance; `count`: how many there are.
double ShareWithin(const Mask& of, const std::vector<double>& squared, double tolerance_px, int64_t* count) {
  int64_t near = 0;
  *count = 0;
  for (size_t i = 0; i < of.size(); ++i) {
    if (!of[i]) continue;
    ++*count;
    near += squared[i] <= tolerance_px * tolerance_px;
  }
  return *count ? static_cast<double>(near) / static_cast<double>(*count) : 0;
}

/// Grows [low, high) to `size` within [0, limit).
void Grow(int* low, int* high, int size, int limit) {
  size = std::min(size, limit);
  if (*high - *low >= size) return;
  *low = std::max(0, std::min(*low - (size - (*high - *low)) / 2, limit - size));
  *high = *low + size;
}

}  // namespace

double MaskIou(const Mask& a, const Mask& b) {
  MVS_CHECK(a.size() == b.size(), "masks of " << a.size() << " and " << b.size() << " pixels");
  int64_t both = 0, any = 0;
  for (size_t i = 0; i < a.size(); ++i) both += a[i] && b[i], any += a[i] || b[i];
  return any ? static_cast<double>(both) / static_cast<double>(any) : 1;
}

std::vector<double> SquaredDistances(const Mask& mask, int width, int height) {
  MVS_CHECK(mask.size() == static_cast<size_t>(width) * height, "the mask has another size");
  std::vector<double> f(mask.size());
  for (size_t i = 0; i < mask.size(); ++i) f[i] = mask[i] ? 0 : kFar;
  const size_t longest = static_cast<size_t>(std::max(width, height));
  std::vector<double> out(longest), bounds(longest + 1);
  std::vector<int> roots(longest);
  for (int x = 0; x < width; ++x) Transform(f.data() + x, height, width, &out, &roots, &bounds);
  for (int y = 0; y < height; ++y) Transform(f.data() + static_cast<size_t>(y) * width, width, 1, &out, &roots, &bounds);
  return f;
}

double BoundaryTolerancePx(int width, int height) { return std::max(1.0, 0.008 * std::hypot(width, height)); }

double BoundaryF(const Mask& truth, const Mask& mask, int width, int height, double tolerance_px) {
  MVS_CHECK(truth.size() == mask.size(), "masks of " << truth.size() << " and " << mask.size() << " pixels");
  const Mask a = Outline(truth, width, height), b = Outline(mask, width, height);
  int64_t count_a = 0, count_b = 0;
  const double recall = ShareWithin(a, SquaredDistances(b, width, height), tolerance_px, &count_a);
  const double precision = ShareWithin(b, SquaredDistances(a, width, height), tolerance_px, &count_b);
  if (count_a == 0 && count_b == 0) return 1;
  return precision + recall > 0 ? 2 * precision * recall / (precision + recall) : 0;
}

Box MaskBox(const Mask& mask, int width, int height, double margin, int least) {
  MVS_CHECK(mask.size() == static_cast<size_t>(width) * height, "the mask has another size");
  Box box{width, height, 0, 0};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (!mask[static_cast<size_t>(y) * width + x]) continue;
      box = {std::min(box.x0, x), std::min(box.y0, y), std::max(box.x1, x + 1), std::max(box.y1, y + 1)};
    }
  }
  if (box.x1 <= box.x0) return {};
  const int grow = static_cast<int>(std::ceil(margin * std::max(box.x1 - box.x0, box.y1 - box.y0)));
  box = {std::max(0, box.x0 - grow), std::max(0, box.y0 - grow), std::min(width, box.x1 + grow),
         std::min(height, box.y1 + grow)};
  Grow(&box.x0, &box.x1, least, width);
  Grow(&box.y0, &box.y1, least, height);
  return box;
}

Score Flicker(const PlanarImage& truth_before, const PlanarImage& truth, const PlanarImage& image_before,
              const PlanarImage& image, const Mask& mask_before, const Mask& mask) {
  for (const PlanarImage* other : {&truth_before, &image_before, &image}) {
    const Status status = Check(truth, *other);
    if (status != Status::kOk) return {status};
  }
  MVS_CHECK(mask.size() == truth.PlaneSize() && mask_before.size() == mask.size(), "a mask has another size");
  double sum = 0;
  int64_t count = 0;
  for (int c = 0; c < truth.channels; ++c) {
    const double *t0 = truth_before.Plane(c), *t1 = truth.Plane(c), *i0 = image_before.Plane(c), *i1 = image.Plane(c);
    for (size_t i = 0; i < mask.size(); ++i) {
      if (mask[i] && mask_before[i]) sum += std::abs((i1[i] - i0[i]) - (t1[i] - t0[i])), ++count;
    }
  }
  if (count == 0) return {Status::kNothingLeft};
  return {Status::kOk, sum / (static_cast<double>(count) * truth.range)};
}

}  // namespace mvstudio::metrics
