#include "python/arrays.h"

#include <algorithm>

#include "core/error.h"
#include "core/parallel.h"

namespace mvstudio::python {

std::string ShapeText(const py::array& array) {
  std::string text;
  for (py::ssize_t i = 0; i < array.ndim(); ++i) text += (i > 0 ? ", " : "") + std::to_string(array.shape(i));
  return "(" + text + (array.ndim() == 1 ? ",)" : ")");
}

Shape LeadingShape(const Doubles& array, py::ssize_t last, const std::string& argument) {
  const py::ssize_t n = array.ndim();
  if (n < 1 || array.shape(n - 1) != last)
    throw UsageError("option '" + argument + "': expected shape (..., " + std::to_string(last) + "), got " + ShapeText(array));
  return Shape(array.shape(), array.shape() + n - 1);
}

Shape With(Shape shape, const Shape& more) {
  shape.insert(shape.end(), more.begin(), more.end());
  return shape;
}

py::ssize_t NumIn(const Shape& shape) {
  py::ssize_t number = 1;
  for (const py::ssize_t n : shape) number *= n;
  return number;
}

void ForPieces(py::ssize_t count, int threads, const std::function<void(py::ssize_t, py::ssize_t)>& body) {
  constexpr py::ssize_t kPiece = 8192;
  const py::gil_scoped_release others_run;
  ParallelFor((count + kPiece - 1) / kPiece, ResolveThreads(threads),
              [&](int64_t i) { body(i * kPiece, std::min<py::ssize_t>(count, (i + 1) * kPiece)); });
}

}  // namespace mvstudio::python
