#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

/// A little of protocol buffers' wire format, enough to write an ONNX file (onnx.proto3).
namespace mvstudio::testing {

inline std::string Varint(uint64_t v) {
  std::string out;
  for (; v >= 128; v >>= 7) out += static_cast<char>(v | 128);
  return out + static_cast<char>(v);
}
inline std::string Number(int field, uint64_t v) { return Varint(uint64_t(field) << 3) + Varint(v); }
inline std::string Bytes(int field, const std::string& b) { return Varint(uint64_t(field) << 3 | 2) + Varint(b.size()) + b; }

inline std::string Tensor(const std::string& name, const std::vector<int64_t>& shape, const std::vector<float>& values) {
  std::string t;
  for (const int64_t d : shape) t += Number(1, uint64_t(d));
  t += Number(2, 1) + Bytes(8, name);  // 1: float
  return t + Bytes(9, std::string(reinterpret_cast<const char*>(values.data()), 4 * values.size()));
}

inline std::string Value(const std::string& name, const std::vector<int64_t>& shape) {
  std::string dims;
  for (const int64_t d : shape) dims += Bytes(1, Number(1, uint64_t(d)));
  return Bytes(1, name) + Bytes(2, Bytes(1, Number(1, 1) + Bytes(2, dims)));
}

/// A 1x1 convolution with `channels` outputs: weights are (channels, 3).
inline void WriteOnnx(const std::string& path, int channels, const std::vector<float>& weights,
                      const std::vector<float>& bias) {
  const std::string node = Bytes(1, "x") + Bytes(1, "w") + Bytes(1, "b") + Bytes(2, "y") + Bytes(3, "conv") + Bytes(4, "Conv") +
                           Bytes(5, Bytes(1, "kernel_shape") + Number(8, 1) + Number(8, 1) + Number(20, 7));  // 7: integers
  const std::string graph = Bytes(1, node) + Bytes(2, "g") + Bytes(5, Tensor("w", {channels, 3, 1, 1}, weights)) +
                            Bytes(5, Tensor("b", {channels}, bias)) + Bytes(11, Value("x", {1, 3, 32, 32})) +
                            Bytes(12, Value("y", {1, channels, 32, 32}));
  std::ofstream(path, std::ios::binary) << Number(1, 7) + Bytes(7, graph) + Bytes(8, Number(2, 11));
}

}  // namespace mvstudio::testing
