#pragma once

#include <cstdint>
#include <string>
#include <vector>

/// A small ONNX net of heat maps.
namespace mvstudio::testing {

/// Protocol buffers by hand: just what a small ONNX file needs.
struct Proto {
  std::string bytes;
  void Varint(uint64_t value) {
    for (; value >= 128; value >>= 7) bytes += static_cast<char>((value & 127) | 128);
    bytes += static_cast<char>(value);
  }
  Proto& Int(int field, uint64_t value) {
    Varint(static_cast<uint64_t>(field) << 3);
    Varint(value);
    return *this;
  }
  Proto& Text(int field, const std::string& text) {
    Varint(static_cast<uint64_t>(field) << 3 | 2);
    Varint(text.size());
    bytes += text;
    return *this;
  }
  Proto& Message(int field, const Proto& message) { return Text(field, message.bytes); }
};

inline Proto TensorInfo(const std::string& name, const std::vector<int>& shape) {
  Proto dims;
  for (const int size : shape) dims.Message(1, Proto().Int(1, static_cast<uint64_t>(size)));
  return Proto().Text(1, name).Message(2, Proto().Message(1, Proto().Int(1, 1).Message(2, dims)));
}

/// A net for 48 x 64 pixels whose heat maps are means of 4x4 pixels: of the red channel, from joint `first_green` on of the
/// green one.
inline std::string TinyOnnx(int joints, int first_green = 1000) {
  std::string weights;
  for (int k = 0; k < joints; ++k) {
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < 16; ++i) {
        const float value = c == (k < first_green ? 0 : 1) ? 1.0f / 16 : 0.0f;
        weights.append(reinterpret_cast<const char*>(&value), 4);
      }
    }
  }
  const auto ints = [](const std::string& name, const std::vector<int>& values) {
    Proto attribute;
    attribute.Text(1, name);
    for (const int value : values) attribute.Int(8, static_cast<uint64_t>(value));
    return attribute.Int(20, 7);
  };
  Proto tensor, node, graph, model;
  for (const int size : {joints, 3, 4, 4}) tensor.Int(1, static_cast<uint64_t>(size));
  tensor.Int(2, 1).Text(8, "w").Text(9, weights);
  node.Text(1, "x")
      .Text(1, "w")
      .Text(2, "y")
      .Text(4, "Conv")
      .Message(5, ints("kernel_shape", {4, 4}))
      .Message(5, ints("strides", {4, 4}));
  graph.Message(1, node).Text(2, "tiny").Message(5, tensor);
  graph.Message(11, TensorInfo("x", {1, 3, 64, 48}))
      .Message(11, TensorInfo("w", {joints, 3, 4, 4}))
      .Message(12, TensorInfo("y", {1, joints, 16, 12}));
  model.Int(1, 7).Message(7, graph).Message(8, Proto().Text(1, "").Int(2, 11));
  return model.bytes;
}

}  // namespace mvstudio::testing
