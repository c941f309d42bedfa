#include "avatar/metrics/psnr.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/sum.h"

namespace mvstudio::metrics {
namespace {

/// `squares`: sum of the squared differences as shares of the range.
Score FromSum(double squares, double count) {
  if (count == 0) return {Status::kNothingLeft};
  return {Status::kOk, -10 * std::log10(squares / count)};
}

/// Rows are added plainly and their sums with what rounding loses: an image of 1e7 pixels keeps 13 digits.
double Squares(const PlanarImage& a, const PlanarImage& b, const Box& box) {
  Sum sum;
  const double range = a.range;
  for (int c = 0; c < a.channels; ++c) {
    for (int y = box.y0; y < box.y1; ++y) {
      const size_t begin = static_cast<size_t>(y) * a.width;
      const double *pa = a.Plane(c) + begin, *pb = b.Plane(c) + begin;
      double row = 0;
      for (int x = box.x0; x < box.x1; ++x) row += ((pa[x] - pb[x]) / range) * ((pa[x] - pb[x]) / range);
      sum.Add(row);
    }
  }
  return sum.value();
}

}  // namespace

Score PsnrDb(const PlanarImage& a, const PlanarImage& b) { return PsnrDb(a, b, Box{0, 0, a.width, a.height}); }

Score PsnrDb(const Image& a, const Image& b) {
  const Status status = Check(a, b);
  if (status != Status::kOk) return {status};
  int64_t sum = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    const int difference = int{a.pixels[i]} - int{b.pixels[i]};
    sum += difference * difference;
  }
  return FromSum(static_cast<double>(sum) / (255 * 255), static_cast<double>(a.pixels.size()));
}

Score PsnrDb(const PlanarImage& a, const PlanarImage& b, const Box& box) {
  const Status status = Check(a, b);
  if (status != Status::kOk) return {status};
  const Box inside{std::max(0, box.x0), std::max(0, box.y0), std::min(a.width, box.x1), std::min(a.height, box.y1)};
  if (inside.x1 <= inside.x0 || inside.y1 <= inside.y0) return {Status::kNothingLeft};
  const double pixels = static_cast<double>(inside.x1 - inside.x0) * (inside.y1 - inside.y0);
  return FromSum(Squares(a, b, inside), pixels * a.channels);
}

Score PsnrDb(const PlanarImage& a, const PlanarImage& b, const Mask& mask) {
  const Status status = Check(a, b);
  if (status != Status::kOk) return {status};
  MVS_CHECK(mask.size() == a.PlaneSize(), "the mask has another size");
  Sum sum;
  int64_t count = 0;
  for (int c = 0; c < a.channels; ++c) {
    const double *pa = a.Plane(c), *pb = b.Plane(c);
    for (size_t i = 0; i < mask.size(); ++i) {
      if (mask[i]) sum.Add(((pa[i] - pb[i]) / a.range) * ((pa[i] - pb[i]) / a.range)), ++count;
    }
  }
  return FromSum(sum.value(), static_cast<double>(count));
}

PsnrSummary MeanPsnr(const std::vector<double>& psnr_db) {
  PsnrSummary summary;
  Sum sum;
  for (const double value : psnr_db) {
    MVS_CHECK(!std::isnan(value), "PSNR is NaN");
    if (std::isinf(value)) {
      ++summary.num_infinite;
    } else {
      sum.Add(value);
    }
  }
  const auto finite = static_cast<int64_t>(psnr_db.size()) - summary.num_infinite;
  const double none = psnr_db.empty() ? std::nan("") : std::numeric_limits<double>::infinity();
  summary.mean_db = finite > 0 ? sum.value() / static_cast<double>(finite) : none;
  return summary;
}

}  // namespace mvstudio::metrics
