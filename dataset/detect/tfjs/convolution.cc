#include "dataset/detect/tfjs/ops.h"

namespace mvstudio::detect::internal {
namespace {

using torch::Tensor;

torch::Tensor Nchw(const Tensor& nhwc) { return nhwc.permute({0, 3, 1, 2}); }
torch::Tensor Nhwc(const Tensor& nchw) { return nchw.permute({0, 2, 3, 1}); }

const std::vector<int64_t>& FourInts(const std::string& path, const TfNode& node, const std::string& key) {
  static const std::vector<int64_t> kOnes = {1, 1, 1, 1};
  const auto found = node.attributes.find(key);
  if (found == node.attributes.end()) return kOnes;
  const std::vector<int64_t>& ints = found->second.ints;
  constexpr int64_t kMax = 4096;
  const bool ok =
      ints.size() == 4 && ints[0] == 1 && ints[3] == 1 && ints[1] >= 1 && ints[2] >= 1 && ints[1] <= kMax && ints[2] <= kMax;
  if (!ok) FailNode(path, node, "attribute " + key + " must be 1, y, x, 1 with y and x from 1 to 4096");
  return ints;
}

std::string TextOr(const std::string& path, const TfNode& node, const std::string& key, const std::string& otherwise) {
  const auto found = node.attributes.find(key);
  if (found == node.attributes.end()) return otherwise;
  if (found->second.texts.size() != 1) FailNode(path, node, "attribute " + key + " must be one text");
  return found->second.texts[0];
}

/// Pads height and width of an NCHW tensor so that a VALID window gives SAME's output.
Tensor PadSame(const std::string& path, const TfNode& node, const Tensor& x, const Window& w, int64_t size_y, int64_t size_x,
               double value) {
  const Padding y = SamePadding(x.size(2), size_y, w.stride_y, w.dilation_y);
  const Padding z = SamePadding(x.size(3), size_x, w.stride_x, w.dilation_x);
  if (y.before + y.after + z.before + z.after == 0) return x;
  CountElements(path, NodeText(node.name),
                {x.size(0), x.size(1), x.size(2) + y.before + y.after, x.size(3) + z.before + z.after});
  return torch::constant_pad_nd(x, {z.before, z.after, y.before, y.after}, value);
}

void CheckFits(const std::string& path, const TfNode& node, const Tensor& x, const Window& w, int64_t size_y, int64_t size_x) {
  const bool fits = x.size(2) >= (size_y - 1) * w.dilation_y + 1 && x.size(3) >= (size_x - 1) * w.dilation_x + 1;
  if (!fits) FailNode(path, node, "its window is larger than its input");
}

/// Convolution of NHWC `x` with a filter (h, w, in, out), or (h, w, in, multiplier) when depthwise.
Tensor Convolve(const std::string& path, const TfNode& node, const Window& w, bool depthwise, const Tensor& x,
                const Tensor& filter, const Tensor& bias) {
  if (x.dim() != 4 || filter.dim() != 4) FailNode(path, node, "input and filter must have four dimensions");
  if (x.size(3) != filter.size(2)) {
    FailNode(path, node, "has " + std::to_string(x.size(3)) + " channels, its filter " + std::to_string(filter.size(2)));
  }
  const int64_t out = depthwise ? filter.size(2) * filter.size(3) : filter.size(3);
  if (bias.defined() && (bias.dim() != 1 || bias.size(0) != out)) FailNode(path, node, "its bias must have a value a channel");
  const int64_t size_y = filter.size(0), size_x = filter.size(1);
  Tensor image = Nchw(x);
  if (w.same) image = PadSame(path, node, image, w, size_y, size_x, 0);
  CheckFits(path, node, image, w, size_y, size_x);
  CountElements(path, NodeText(node.name), {x.size(0), out, image.size(2) / w.stride_y + 1, image.size(3) / w.stride_x + 1});
  const Tensor weight = depthwise ? filter.permute({2, 3, 0, 1}).reshape({out, 1, size_y, size_x})
                                  : filter.permute({3, 2, 0, 1}).contiguous(at::MemoryFormat::ChannelsLast);
  const int64_t groups = depthwise ? filter.size(2) : 1;
  const std::vector<int64_t> stride = {w.stride_y, w.stride_x}, padding = {0, 0}, dilation = {w.dilation_y, w.dilation_x};
  return Nhwc(torch::conv2d(image, weight, bias, stride, padding, dilation, groups));
}

/// What follows a fused convolution.
struct Fused {
  bool bias = false;
  std::string activation;
};

Fused ReadFused(const std::string& path, const TfNode& node) {
  Fused fused;
  const auto found = node.attributes.find("fused_ops");
  if (found == node.attributes.end()) return fused;
  for (const std::string& op : found->second.texts) {
    if (op == "BiasAdd" && !fused.bias && fused.activation.empty()) {
      fused.bias = true;
    } else if ((op == "Relu" || op == "Relu6") && fused.activation.empty()) {
      fused.activation = op;
    } else {
      FailNode(path, node, "fuses " + op + ", which is not known there");
    }
  }
  return fused;
}

Tensor Activate(const std::string& activation, const Tensor& x) {
  if (activation == "Relu") return torch::relu(x);
  return activation == "Relu6" ? torch::clamp(x, 0, 6) : x;
}

/// The gradient of a convolution with a filter (h, w, out, in), which TensorFlow uses as transposed convolution; `sizes` is the
/// NHWC shape of the result.
Tensor ConvolveTransposed(const std::string& path, const TfNode& node, const Window& w, const Tensor& sizes,
                          const Tensor& filter, const Tensor& x) {
  const bool shapes =
      x.dim() == 4 && filter.dim() == 4 && sizes.dim() == 1 && sizes.size(0) == 4 && sizes.scalar_type() == torch::kInt;
  if (!shapes) FailNode(path, node, "needs four sizes, a filter and an input of four dimensions");
  const int64_t height = sizes[1].item<int>(), width = sizes[2].item<int>();
  const int64_t size_y = filter.size(0), size_x = filter.size(1);
  if (height < 1 || width < 1 || filter.size(3) != x.size(3) || sizes[3].item<int>() != filter.size(2)) {
    FailNode(path, node, "its sizes, filter and input do not fit together");
  }
  CountElements(path, NodeText(node.name), {x.size(0), filter.size(2), height, width});
  const auto outputs = [&](int64_t inputs, int64_t window, int64_t stride) {
    return w.same ? (inputs + stride - 1) / stride : (inputs - window) / stride + 1;
  };
  if (outputs(height, size_y, w.stride_y) != x.size(1) || outputs(width, size_x, w.stride_x) != x.size(2) ||
      w.dilation_y != 1 || w.dilation_x != 1) {
    FailNode(path, node, "its sizes do not belong to its input");
  }
  const Padding y = w.same ? SamePadding(height, size_y, w.stride_y, 1) : Padding{};
  const Padding z = w.same ? SamePadding(width, size_x, w.stride_x, 1) : Padding{};
  CountElements(path, NodeText(node.name),
                {x.size(0), filter.size(2), x.size(1) * w.stride_y + size_y, x.size(2) * w.stride_x + size_x});
  Tensor full = torch::conv_transpose2d(Nchw(x), filter.permute({3, 2, 0, 1}).contiguous(), {}, {w.stride_y, w.stride_x});
  const int64_t missing_y = std::max<int64_t>(0, y.before + height - full.size(2));
  const int64_t missing_x = std::max<int64_t>(0, z.before + width - full.size(3));
  if (missing_y + missing_x > 0) full = torch::constant_pad_nd(full, {0, missing_x, 0, missing_y}, 0);
  return Nhwc(full.narrow(2, y.before, height).narrow(3, z.before, width));
}

}  // namespace

Window ReadWindow(const std::string& path, const TfNode& node) {
  if (TextOr(path, node, "data_format", "NHWC") != "NHWC") FailNode(path, node, "data_format must be NHWC");
  Window window;
  const std::string padding = TextOr(path, node, "padding", "");
  if (padding != "SAME" && padding != "VALID") FailNode(path, node, "padding must be SAME or VALID");
  window.same = padding == "SAME";
  const std::vector<int64_t>& strides = FourInts(path, node, "strides");
  const std::vector<int64_t>& dilations = FourInts(path, node, "dilations");
  const std::vector<int64_t>& sizes = FourInts(path, node, "ksize");
  window.stride_y = strides[1], window.stride_x = strides[2];
  window.dilation_y = dilations[1], window.dilation_x = dilations[2];
  window.size_y = sizes[1], window.size_x = sizes[2];
  return window;
}

Padding SamePadding(int64_t inputs, int64_t window, int64_t stride, int64_t dilation) {
  const int64_t outputs = (inputs + stride - 1) / stride;
  const int64_t total = std::max<int64_t>(0, (outputs - 1) * stride + (window - 1) * dilation + 1 - inputs);
  return {total / 2, total - total / 2};
}

Operation CompileConvolution(const std::string& path, const TfNode& node) {
  const std::string& op = node.op;
  if (op == "Conv2DBackpropInput") {
    if (node.inputs.size() != 3) FailNode(path, node, "must have three inputs");
    return [path, node, w = ReadWindow(path, node)](const std::vector<Tensor>& in) {
      return ConvolveTransposed(path, node, w, in[0], in[1], in[2]);
    };
  }
  const bool fused_op = op == "_FusedConv2D" || op == "FusedDepthwiseConv2dNative";
  const bool depthwise = op == "DepthwiseConv2dNative" || op == "FusedDepthwiseConv2dNative";
  if (!fused_op && !depthwise && op != "Conv2D") return {};
  const Fused fused = fused_op ? ReadFused(path, node) : Fused{};
  const size_t num_inputs = fused.bias ? 3 : 2;
  if (node.inputs.size() != num_inputs) FailNode(path, node, "must have " + std::to_string(num_inputs) + " inputs");
  return [path, node, fused, depthwise, w = ReadWindow(path, node)](const std::vector<Tensor>& in) {
    return Activate(fused.activation, Convolve(path, node, w, depthwise, in[0], in[1], fused.bias ? in[2] : Tensor()));
  };
}

Operation CompilePooling(const std::string& path, const TfNode& node) {
  if (node.op != "AvgPool" && node.op != "MaxPool") return {};
  if (node.inputs.size() != 1) FailNode(path, node, "must have one input");
  const bool mean = node.op == "AvgPool";
  return [path, node, mean, w = ReadWindow(path, node)](const std::vector<Tensor>& in) {
    if (in[0].dim() != 4) FailNode(path, node, "its input must have four dimensions");
    Tensor x = Nchw(in[0]);
    Tensor weight = torch::ones({1, 1, x.size(2), x.size(3)});
    if (w.same) {
      weight = PadSame(path, node, weight, w, w.size_y, w.size_x, 0);
      x = PadSame(path, node, x, w, w.size_y, w.size_x, mean ? 0 : -std::numeric_limits<float>::infinity());
    }
    CheckFits(path, node, x, w, w.size_y, w.size_x);
    const std::vector<int64_t> size = {w.size_y, w.size_x}, stride = {w.stride_y, w.stride_x};
    if (!mean) return Nhwc(torch::max_pool2d(x, size, stride));
    const Tensor sum = torch::avg_pool2d(x, size, stride);
    return Nhwc(w.same ? sum / torch::avg_pool2d(weight, size, stride) : sum);  // padding does not count
  };
}

}  // namespace mvstudio::detect::internal
