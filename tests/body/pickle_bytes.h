#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/disk/npy.h"

/// Pickles of protocol 2, part by part.
namespace mvstudio::body::pickle_bytes {

/// A number in four bytes, the lowest first.
inline std::string Bytes4(size_t value) {
  std::string bytes;
  for (int k = 0; k < 4; ++k) bytes += static_cast<char>(value >> (8 * k));
  return bytes;
}
inline std::string Short(const std::string& text) { return "U" + std::string(1, static_cast<char>(text.size())) + text; }
inline std::string Int(int value) { return "J" + Bytes4(static_cast<size_t>(value)); }

/// numpy's array of float64; `shape`: what pushes its tuple.
inline std::string Array(const std::string& shape, const std::vector<double>& values) {
  using namespace std::string_literals;
  const std::string bytes(reinterpret_cast<const char*>(values.data()), 8 * values.size());
  return "cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\nK\0\x85U\1btR(K\1"s + shape +
         "cnumpy\ndtype\n(U\2f8K\0K\1tR(K\3U\1<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0tb\x89"s +
         (bytes.size() < 256 ? Short(bytes) : "T" + Bytes4(bytes.size()) + bytes) + "tb"s;
}

inline std::string Dict(const std::string& entries) { return std::string("\x80\2}(") + entries + "u."; }

inline std::string DictOf(const std::map<std::string, NpyArray>& arrays) {
  std::string entries;
  for (const auto& [name, array] : arrays) {
    std::string shape = "(";
    for (const int64_t size : array.shape) shape += Int(static_cast<int>(size));
    entries += Short(name) + Array(shape + "t", array.values);
  }
  return Dict(entries);
}

}  // namespace mvstudio::body::pickle_bytes
