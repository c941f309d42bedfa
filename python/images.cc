#include <string>
#include <type_traits>

#include "avatar/metrics/psnr.h"
#include "avatar/metrics/ssim.h"
#include "core/error.h"
#include "python/arrays.h"
#include "python/bindings.h"

namespace mvstudio::python {
namespace {

using Planes = std::decay_t<decltype(metrics::FromImage(Image()))>;
using metrics::Score;

/// (h, w) or (h, w, channels) -> planes.
Planes PlanesOf(const Doubles& image, double range, const std::string& argument) {
  if (image.ndim() != 2 && image.ndim() != 3)
    throw UsageError("option '" + argument + "': expected shape (h, w) or (h, w, channels), got " + ShapeText(image));
  Planes planes;
  planes.height = static_cast<int>(image.shape(0)), planes.width = static_cast<int>(image.shape(1));
  planes.channels = image.ndim() == 3 ? static_cast<int>(image.shape(2)) : 1;
  planes.range = range;
  const size_t pixels = planes.PlaneSize(), channels = static_cast<size_t>(planes.channels);
  planes.samples.resize(pixels * channels);
  const double* from = image.data();
  for (size_t i = 0; i < pixels; ++i)
    for (size_t c = 0; c < channels; ++c) planes.samples[c * pixels + i] = from[i * channels + c];
  return planes;
}

double ValueOr(const Score& score) {
  if (score.status == metrics::Status::kOk) return score.value;
  throw UsageError(std::string("the images cannot be compared: ") + metrics::ToString(score.status));
}

double Ssim(const Doubles& a, const Doubles& b, double range, const std::string& window, int threads) {
  const Planes first = PlanesOf(a, range, "a"), second = PlanesOf(b, range, "b");
  if (window != "gaussian11" && window != "uniform7")
    throw UsageError("option 'window' " + window + ": expected gaussian11 or uniform7");
  const auto kind = window == "uniform7" ? metrics::SsimWindow::kUniform7 : metrics::SsimWindow::kWang2004;
  const py::gil_scoped_release others_run;
  return ValueOr(metrics::Ssim(first, second, kind, threads));
}

double Psnr(const Doubles& a, const Doubles& b, double range) {
  const Planes first = PlanesOf(a, range, "a"), second = PlanesOf(b, range, "b");
  const py::gil_scoped_release others_run;
  return ValueOr(metrics::PsnrDb(first, second));
}

}  // namespace

void BindImages(py::module_& module) {
  module.def("ssim", Ssim);
  module.def("psnr_db", Psnr);
}

}  // namespace mvstudio::python
