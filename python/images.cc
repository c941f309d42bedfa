#include <algorithm>
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

const char* WhyNot(metrics::Status status) {
  switch (status) {
    case metrics::Status::kSizesDiffer:
      return "their shapes differ";
    case metrics::Status::kTooSmall:
      return "they are smaller than the window, 11 x 11 px, or 7 x 7 of uniform7";
    case metrics::Status::kNotFinite:
      return "they hold NaN or infinity";
    case metrics::Status::kOutsideRange:
      return "they hold numbers outside 0 to the range; option 'data-range' states it, e.g. 255";
    default:
      return "they hold no pixel";
  }
}

double ValueOr(const Score& score) {
  if (score.status == metrics::Status::kOk) return score.value;
  throw UsageError(std::string("the images cannot be compared: ") + WhyNot(score.status));
}

double Ssim(const Doubles& a, const Doubles& b, double range, const std::string& window, int threads) {
  const Planes first = PlanesOf(a, range, "a"), second = PlanesOf(b, range, "b");
  if (window != "gaussian11" && window != "uniform7")
    throw UsageError("option 'window' " + window + ": expected gaussian11 or uniform7");
  const auto kind = window == "uniform7" ? metrics::SsimWindow::kUniform7 : metrics::SsimWindow::kWang2004;
  const py::gil_scoped_release others_run;
  return ValueOr(metrics::Ssim(first, second, kind, threads));
}

double PsnrOfNumbers(const Doubles& a, const Doubles& b, double range) {
  const Planes first = PlanesOf(a, range, "a"), second = PlanesOf(b, range, "b");
  const py::gil_scoped_release others_run;
  return ValueOr(metrics::PsnrDb(first, second));
}

/// An 8-bit image as the program has it, whose squares are summed exactly; empty where `image` is none.
Image PixelsOf(const py::object& image) {
  using Bytes = py::array_t<uint8_t, py::array::c_style>;
  if (!py::isinstance<py::array_t<uint8_t>>(image)) return {};
  const auto array = py::reinterpret_borrow<py::array>(image);
  if (array.ndim() != 2 && array.ndim() != 3) return {};
  const Bytes rows = Bytes::ensure(array);
  const int channels = rows.ndim() == 3 ? static_cast<int>(rows.shape(2)) : 1;
  Image bytes(static_cast<int>(rows.shape(1)), static_cast<int>(rows.shape(0)), channels);
  std::copy(rows.data(), rows.data() + rows.size(), bytes.pixels.begin());
  return bytes;
}

/// Throws TypeError where `image` is no array of numbers.
Doubles NumbersOf(const py::object& image, const std::string& argument) {
  Doubles numbers = Doubles::ensure(image);  // clears numpy's error
  if (!numbers)
    throw py::type_error("`" + argument + "` is no array of numbers: " + py::str(py::type::of(image)).cast<std::string>());
  return numbers;
}

double Psnr(const py::object& a, const py::object& b, double range) {
  const Image bytes_a = PixelsOf(a), bytes_b = PixelsOf(b);
  if (!bytes_a.empty() && !bytes_b.empty() && range == 255) {
    const py::gil_scoped_release others_run;
    return ValueOr(metrics::PsnrDb(bytes_a, bytes_b));
  }
  return PsnrOfNumbers(NumbersOf(a, "a"), NumbersOf(b, "b"), range);
}

}  // namespace

void BindImages(py::module_& module) {
  module.def("ssim", Ssim);
  module.def("psnr_db", Psnr);
}

}  // namespace mvstudio::python
