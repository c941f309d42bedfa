#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

/// numpy's files, written byte by byte: .npy (format 1.0, numpy.lib.format), .npz (an uncompressed ZIP archive) and the
/// pickle inside a .npy of objects.
namespace mvstudio::exports {

/// A `.npy` of little-endian doubles, row by row.
std::string NpyOfDoubles(const std::vector<size_t>& shape, const std::vector<double>& values);
std::string NpyOfInts(const std::vector<size_t>& shape, const std::vector<int64_t>& values);
/// A 1-D array of text, dtype `<U…`. Throws UsageError for text that is not UTF-8.
std::string NpyOfTexts(const std::vector<std::string>& texts);

/// ZIP archive of stored members, the form of numpy.savez; names without `.npy`. Throws UsageError beyond 4 GiB.
std::string NpzOf(const std::vector<std::pair<std::string, std::string>>& members);

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
