// Private: libtorch's types.
#pragma once

#include <torch/torch.h>

#include <functional>
#include <string>
#include <vector>

#include "core/error.h"
#include "dataset/detect/tfjs/parsed_graph.h"

/// The operations of TensorFlow graphs on libtorch; only for .cc files with the precompiled torch header.
namespace mvstudio::detect::internal {

/// Values are NHWC and float32, or int32 for sizes; inputs are in the node's order.
using Operation = std::function<torch::Tensor(const std::vector<torch::Tensor>&)>;

/// Reads the attributes of `node` once. Throws FormatError naming operation and node when the operation is unknown. The
/// returned function throws FormatError for invalid inputs.
Operation CompileOperation(const std::string& path, const TfNode& node);

/// A window's attributes: convolution, transposed convolution and pooling.
struct Window {
  int64_t stride_y = 1, stride_x = 1, dilation_y = 1, dilation_x = 1;
  int64_t size_y = 0, size_x = 0;  // pooling only
  bool same = false;
};
Window ReadWindow(const std::string& path, const TfNode& node);

/// Padding before and after for TensorFlow's SAME: outputs = ceil(inputs / stride), the odd row last.
struct Padding {
  int64_t before = 0, after = 0;
};
Padding SamePadding(int64_t inputs, int64_t window, int64_t stride, int64_t dilation);

[[noreturn]] void FailNode(const std::string& path, const TfNode& node, const std::string& what);

/// The window operations; empty for any other operation.
Operation CompileConvolution(const std::string& path, const TfNode& node);
Operation CompilePooling(const std::string& path, const TfNode& node);
Operation CompileResize(const std::string& path, const TfNode& node);
Operation CompilePad(const std::string& path, const TfNode& node);

}  // namespace mvstudio::detect::internal
