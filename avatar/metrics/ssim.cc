#include "avatar/metrics/ssim.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "avatar/metrics/ssim_kernel.h"
#include "core/check.h"
#include "core/parallel.h"

namespace mvstudio::metrics {
namespace {

/// Fewer samples than this are not worth a thread of their own.
constexpr int64_t kSamplesPerThread = 1 << 17;

/// Calls strip(x0, count) for strips of about equal width that make `cols` columns together.
void ForStrips(const Samples& samples, int cols, int num_threads, const std::function<void(int, int)>& strip) {
  const int64_t strips = (cols + kSsimStrip - 1) / kSsimStrip;
  const int64_t work = int64_t{samples.width} * samples.height * samples.NumPlanes();
  const int64_t threads = std::clamp<int64_t>(work / kSamplesPerThread, 1, ResolveThreads(num_threads));
  ParallelFor(strips, static_cast<int>(threads), [&](int64_t i) {
    const auto begin = static_cast<int>(cols * i / strips), end = static_cast<int>(cols * (i + 1) / strips);
    strip(begin, end - begin);
  });
}

/// Mean over windows and planes, without a map. The images have been checked.
Score MeanSsim(const Samples& a, const Samples& b, SsimWindow window, int num_threads) {
  const int cols = a.width - SsimWindowSize(window) + 1, rows = a.height - SsimWindowSize(window) + 1;
  std::vector<double> sums(static_cast<size_t>(cols), 0.0);
  ForStrips(a, cols, num_threads, [&](int x0, int count) { AddSsimStrip(a, b, window, x0, count, 1, sums.data() + x0, 0); });
  double sum = 0;
  for (const double column : sums) sum += column;
  return {Status::kOk, sum / (static_cast<double>(cols) * rows * a.NumPlanes())};
}

Samples AsLuma(Samples samples) {
  MVS_CHECK(samples.channels == 1 || samples.channels == 3, "luma needs 1 or 3 channels, got " << samples.channels);
  samples.luma = samples.channels == 3;
  return samples;
}

}  // namespace

int SsimWindowSize(SsimWindow window) { return window == SsimWindow::kUniform7 ? 7 : 11; }

SsimMap ComputeSsimMap(const PlanarImage& a, const PlanarImage& b, SsimWindow window, int num_threads) {
  const int side = SsimWindowSize(window);
  SsimMap map;
  map.status = Check(a, b, side);
  if (map.status != Status::kOk) return map;
  map.border = side / 2;
  map.width = a.width - side + 1, map.height = a.height - side + 1;
  map.values.assign(static_cast<size_t>(map.width) * map.height, 0.0);
  ForStrips(SamplesOf(a), map.width, num_threads, [&](int x0, int count) {
    AddSsimStrip(SamplesOf(a), SamplesOf(b), window, x0, count, 1.0 / a.channels, map.values.data() + x0, map.width);
  });
  return map;
}

Score Mean(const SsimMap& map) { return Mean(map, Box{0, 0, map.width + 2 * map.border, map.height + 2 * map.border}); }

Score Mean(const SsimMap& map, const Box& box) {
  if (map.status != Status::kOk) return {map.status};
  const int x0 = std::max(0, box.x0), x1 = std::min(map.width, box.x1 - 2 * map.border);
  const int y0 = std::max(0, box.y0), y1 = std::min(map.height, box.y1 - 2 * map.border);
  if (x1 <= x0 || y1 <= y0) return {Status::kNothingLeft};
  double sum = 0;
  for (int y = y0; y < y1; ++y) {
    const double* row = map.values.data() + static_cast<size_t>(y) * map.width;
    for (int x = x0; x < x1; ++x) sum += row[x];
  }
  return {Status::kOk, sum / (static_cast<double>(x1 - x0) * (y1 - y0))};
}

Score Mean(const SsimMap& map, const Mask& mask) {
  if (map.status != Status::kOk) return {map.status};
  const size_t stride = static_cast<size_t>(map.width) + 2 * map.border;
  MVS_CHECK(mask.size() == stride * (static_cast<size_t>(map.height) + 2 * map.border), "the mask has another size");
  double sum = 0;
  int64_t count = 0;
  for (int y = 0; y < map.height; ++y) {
    const uint8_t* inside = mask.data() + (static_cast<size_t>(y) + map.border) * stride + map.border;
    const double* row = map.values.data() + static_cast<size_t>(y) * map.width;
    for (int x = 0; x < map.width; ++x) {
      if (inside[x]) sum += row[x], ++count;
    }
  }
  if (count == 0) return {Status::kNothingLeft};
  return {Status::kOk, sum / static_cast<double>(count)};
}

Score Ssim(const PlanarImage& a, const PlanarImage& b, SsimWindow window, int num_threads) {
  const Status status = Check(a, b, SsimWindowSize(window));
  if (status != Status::kOk) return {status};
  return MeanSsim(SamplesOf(a), SamplesOf(b), window, num_threads);
}

Score Ssim(const Image& a, const Image& b, SsimWindow window, int num_threads) {
  const Status status = Check(a, b, SsimWindowSize(window));
  if (status != Status::kOk) return {status};
  return MeanSsim(SamplesOf(a), SamplesOf(b), window, num_threads);
}

Score SsimOfLuma(const PlanarImage& a, const PlanarImage& b, SsimWindow window, int num_threads) {
  const Status status = Check(a, b, SsimWindowSize(window));
  if (status != Status::kOk) return {status};
  return MeanSsim(AsLuma(SamplesOf(a)), AsLuma(SamplesOf(b)), window, num_threads);
}

Score SsimOfLuma(const Image& a, const Image& b, SsimWindow window, int num_threads) {
  const Status status = Check(a, b, SsimWindowSize(window));
  if (status != Status::kOk) return {status};
  return MeanSsim(AsLuma(SamplesOf(a)), AsLuma(SamplesOf(b)), window, num_threads);
}

}  // namespace mvstudio::metrics
