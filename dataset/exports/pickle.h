#pragma once

#include <string>
#include <utility>
#include <vector>

/// The pickle inside a .npy of objects (core/disk/npy_write.h), written byte by byte.
namespace mvstudio::exports {

/// A Python object for pickling: a dict, a list, text, or an array of doubles.
class PyValue {
 public:
  static PyValue Text(const std::string& utf8);
  static PyValue List(const std::vector<PyValue>& items);
  static PyValue Dict(const std::vector<std::pair<std::string, PyValue>>& items);
  static PyValue Array(const std::vector<size_t>& shape, const std::vector<double>& values);

  /// A `.npy` of this one object, in the form of numpy.save (pickle protocol 3): `numpy.load(path,
  /// allow_pickle=True).item()`.
  std::string ToNpy() const;

 private:
  std::string opcodes_;  ///< leaves the object on the unpickler's stack
};

}  // namespace mvstudio::exports
