#include "avatar/metrics/planar_image.h"

#include <cmath>

#include "avatar/metrics/simd.h"
#include "core/check.h"

namespace mvstudio::metrics {
namespace {

/// Samples outside [low, high], NaN among them.
MVS_SIMD int64_t CountOutside(const double* samples, int64_t count, double low, double high) {
  int64_t outside = 0;
  for (int64_t i = 0; i < count; ++i) outside += !(samples[i] >= low && samples[i] <= high);
  return outside;
}

Status CheckSamples(const PlanarImage& planar) {
  const double slack = 1e-6 * planar.range;
  if (CountOutside(planar.samples.data(), static_cast<int64_t>(planar.samples.size()), -slack, planar.range + slack) == 0)
    return Status::kOk;
  for (const double v : planar.samples) {
    if (!std::isfinite(v)) return Status::kNotFinite;
  }
  return Status::kOutsideRange;
}

}  // namespace

PlanarImage FromImage(const Image& image) {
  PlanarImage planar{image.width, image.height, image.channels, 255, {}};
  const size_t plane = planar.PlaneSize(), channels = static_cast<size_t>(image.channels);
  planar.samples.resize(plane * channels);
  for (size_t i = 0; i < plane; ++i) {
    for (size_t c = 0; c < channels; ++c) planar.samples[c * plane + i] = image.pixels[i * channels + c];
  }
  return planar;
}

PlanarImage Luma(const PlanarImage& planar) {
  if (planar.channels == 1) return planar;
  MVS_CHECK(planar.channels == 3, "luma needs 1 or 3 channels, got " << planar.channels);
  PlanarImage luma{planar.width, planar.height, 1, planar.range, std::vector<double>(planar.PlaneSize())};
  const double *r = planar.Plane(0), *g = planar.Plane(1), *b = planar.Plane(2);
  for (size_t i = 0; i < luma.samples.size(); ++i) luma.samples[i] = 0.299 * r[i] + 0.587 * g[i] + 0.114 * b[i];
  return luma;
}

const char* ToString(Status status) {
  switch (status) {
    case Status::kOk:
      return "Ok";
    case Status::kSizesDiffer:
      return "SizesDiffer";
    case Status::kTooSmall:
      return "TooSmall";
    case Status::kNotFinite:
      return "NotFinite";
    case Status::kOutsideRange:
      return "OutsideRange";
    case Status::kNothingLeft:
      return "NothingLeft";
  }
  return "";
}

Status Check(const PlanarImage& a, const PlanarImage& b, int least) {
  if (a.width != b.width || a.height != b.height || a.channels != b.channels || a.range != b.range) return Status::kSizesDiffer;
  if (a.samples.size() != b.samples.size() || a.samples.size() != a.PlaneSize() * static_cast<size_t>(a.channels))
    return Status::kSizesDiffer;
  if (a.width < least || a.height < least || a.samples.empty() || !(a.range > 0)) return Status::kTooSmall;
  if (!std::isfinite(1 / a.range) || !std::isfinite(a.range)) return Status::kNotFinite;
  for (const PlanarImage* planar : {&a, &b}) {
    const Status status = CheckSamples(*planar);
    if (status != Status::kOk) return status;
  }
  return Status::kOk;
}

Status Check(const Image& a, const Image& b, int least) {
  if (a.width != b.width || a.height != b.height || a.channels != b.channels) return Status::kSizesDiffer;
  return a.width < least || a.height < least || a.empty() ? Status::kTooSmall : Status::kOk;
}

}  // namespace mvstudio::metrics
