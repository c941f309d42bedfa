#include "python/samples.h"

#include <pybind11/stl.h>

#include <cmath>
#include <limits>

#include "core/error.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "python/rig.h"

namespace mvstudio::python {
namespace {

using dataset::PackSample;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr py::ssize_t kJoints = 19;

/// (N, ...) filled sample by sample: fill(sample, where its values begin).
template <class T, class Fill>
py::array_t<T> Column(const std::vector<PackSample>& samples, const Shape& rest, const Fill& fill) {
  Shape shape{static_cast<py::ssize_t>(samples.size())};
  py::array_t<T> column(With(std::move(shape), rest));
  T* to = column.mutable_data();
  for (const PackSample& sample : samples) fill(sample, to), to += NumIn(rest);
  return column;
}

void AddViews(const std::vector<PackSample>& samples, py::dict* table) {
  (*table)["size_px"] = Column<int32_t>(
      samples, {2}, [](const PackSample& s, int32_t* to) { to[0] = s.view.camera.width_px, to[1] = s.view.camera.height_px; });
  (*table)["K"] = Column<double>(samples, {3, 3}, [](const PackSample& s, double* to) {
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> matrix(to);
    matrix = s.view.camera.K();
  });
  (*table)["cam_from_world"] = Column<double>(samples, {4, 4}, [](const PackSample& s, double* to) {
    Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> matrix(to);
    matrix = geometry::ToMatrix(s.view.cam_from_world);
  });
}

void AddJoints(const std::vector<PackSample>& samples, py::dict* table) {
  (*table)["joints_in_world"] = Column<double>(samples, {kJoints, 3}, [](const PackSample& s, double* to) {
    for (int j = 0; j < kJoints; ++j)
      for (int k = 0; k < 3; ++k) *to++ = s.pose.valid[j] ? s.pose.x_in_world(k, j) : kNan;
  });
  (*table)["confidence"] = Column<double>(samples, {kJoints}, [](const PackSample& s, double* to) {
    for (int j = 0; j < kJoints; ++j) to[j] = s.pose.confidence[j];
  });
  (*table)["joints_px"] = Column<double>(samples, {kJoints, 2}, [](const PackSample& s, double* to) {
    for (int j = 0; j < kJoints; ++j)
      for (int k = 0; k < 2; ++k) *to++ = s.in_view[j] ? s.joints_px(k, j) : kNan;
  });
}

py::dict Table(const SampleSource& source) {
  const std::vector<PackSample>& samples = source.samples();
  const auto number = [&](auto value) {
    return Column<int64_t>(samples, {}, [&](const PackSample& s, int64_t* to) { *to = value(s); });
  };
  py::dict table;
  table["camera"] = number([](const PackSample& s) { return s.camera_idx; });
  table["frame"] = number([](const PackSample& s) { return s.frame; });
  table["person"] = number([](const PackSample& s) { return s.person; });
  table["part"] = number([](const PackSample& s) { return static_cast<int>(s.part); });
  table["has_mask"] = Column<bool>(samples, {}, [](const PackSample& s, bool* to) { *to = s.has_mask; });
  table["univ_time_ms"] =
      Column<double>(samples, {}, [](const PackSample& s, double* to) { *to = s.univ_time_ms == -1 ? kNan : s.univ_time_ms; });
  AddViews(samples, &table);
  AddJoints(samples, &table);
  return table;
}

/// (height, width, 3), or of one channel (height, width).
py::array_t<uint8_t> ArrayOf(const Image& image) {
  Shape shape{image.height, image.width};
  if (image.channels > 1) shape.push_back(image.channels);
  py::array_t<uint8_t> array(shape);
  std::copy(image.pixels.begin(), image.pixels.end(), array.mutable_data());
  return array;
}

size_t RowOf(const SampleSource& source, py::ssize_t i) {
  const auto size = static_cast<py::ssize_t>(source.samples().size());
  if (i < 0 || i >= size) throw py::index_error(std::to_string(i) + " is none of the " + std::to_string(size) + " samples");
  return static_cast<size_t>(i);
}

py::array_t<uint8_t> ImageOf(const SampleSource& source, py::ssize_t i) {
  const size_t row = RowOf(source, i);
  Image image;
  {
    const py::gil_scoped_release others_run;
    image = source.ReadImage(row);
  }
  return ArrayOf(image);
}

py::object MaskOf(const SampleSource& source, py::ssize_t i) {
  const size_t row = RowOf(source, i);
  Image mask;
  {
    const py::gil_scoped_release others_run;
    mask = source.ReadMask(row);
  }
  if (mask.empty()) return py::none();
  return ArrayOf(mask);
}

std::shared_ptr<SampleSource> OpenPackOf(const std::string& path, bool check) {
  const py::gil_scoped_release others_run;
  return OpenPackSource(path, check);
}

std::shared_ptr<SampleSource> OpenDatasetOf(const std::string& folder, int crop_px, double fill, double half_extent_m,
                                            int person, bool masks, const std::string& split) {
  const py::gil_scoped_release others_run;
  return OpenDatasetSource(folder, {crop_px, fill, half_extent_m, person, masks, split});
}

}  // namespace

void BindSamples(py::module_& module) {
  py::class_<SampleSource, std::shared_ptr<SampleSource>> source(module, "Samples");
  source.def("__len__", [](const SampleSource& s) { return s.samples().size(); });
  source.def("about", &SampleSource::About);
  source.def("rig", [](const SampleSource& s) { return std::make_shared<HeldRig>(s.rig()); });
  source.def("table", Table);
  source.def("image", ImageOf);
  source.def("mask", MaskOf);
  source.def("image_bytes", [](const SampleSource& s, py::ssize_t i) { return py::bytes(s.ReadImageBytes(RowOf(s, i))); });
  module.def("open_pack", OpenPackOf);
  module.def("open_dataset", OpenDatasetOf);
}

}  // namespace mvstudio::python
