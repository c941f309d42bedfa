// Private: pybind11's types.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <functional>
#include <string>
#include <vector>

/// Arrays in and out: what is given becomes contiguous doubles, what is returned belongs to NumPy.
namespace mvstudio::python {

namespace py = pybind11;
using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Shape = std::vector<py::ssize_t>;

/// "(3, 2)".
std::string ShapeText(const py::array& array);

/// The shape without its last axis, which must have `last` entries. Throws UsageError that names the argument.
Shape LeadingShape(const Doubles& array, py::ssize_t last, const std::string& argument);

/// `shape` with more axes behind it.
Shape With(Shape shape, const Shape& more);

py::ssize_t NumIn(const Shape& shape);

/// Calls body(begin, end) for the pieces of [0, count) on `threads` threads (0: all), without Python's lock.
void ForPieces(py::ssize_t count, int threads, const std::function<void(py::ssize_t, py::ssize_t)>& body);

}  // namespace mvstudio::python
