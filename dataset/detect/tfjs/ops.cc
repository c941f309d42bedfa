#include "dataset/detect/tfjs/ops.h"

namespace mvstudio::detect::internal {
namespace {

using torch::Tensor;
using Binary = Tensor (*)(const Tensor&, const Tensor&);
using Unary = Tensor (*)(const Tensor&);

Tensor Plus(const Tensor& a, const Tensor& b) { return a + b; }
Tensor Minus(const Tensor& a, const Tensor& b) { return a - b; }
Tensor Times(const Tensor& a, const Tensor& b) { return a * b; }
Tensor Clamp6(const Tensor& x) { return torch::clamp(x, 0, 6); }
Tensor Relu(const Tensor& x) { return torch::relu(x); }
Tensor Sigmoid(const Tensor& x) { return torch::sigmoid(x); }
Tensor Same(const Tensor& x) { return x; }

Binary FindBinary(const std::string& op) {
  if (op == "Add" || op == "AddV2" || op == "BiasAdd") return Plus;
  if (op == "Sub") return Minus;
  return op == "Mul" ? Times : nullptr;
}

Unary FindUnary(const std::string& op) {
  if (op == "Relu") return Relu;
  if (op == "Relu6") return Clamp6;
  if (op == "Sigmoid") return Sigmoid;
  return op == "Identity" ? Same : nullptr;
}

/// Refuses shapes that do not broadcast, and those that do into something huge.
void CheckBroadcast(const std::string& path, const TfNode& node, const Tensor& a, const Tensor& b) {
  std::vector<int64_t> shape(static_cast<size_t>(std::max(a.dim(), b.dim())));
  for (size_t i = 0; i < shape.size(); ++i) {
    const int64_t from_end = static_cast<int64_t>(i) + 1;
    const int64_t p = from_end <= a.dim() ? a.size(-from_end) : 1, q = from_end <= b.dim() ? b.size(-from_end) : 1;
    if (p != q && p != 1 && q != 1)
      FailNode(path, node, "its inputs have sizes " + std::to_string(p) + " and " + std::to_string(q));
    shape[i] = p == 1 ? q : p;
  }
  CountElements(path, NodeText(node.name), shape);
}

void CheckInputs(const std::string& path, const TfNode& node, size_t count) {
  if (node.inputs.size() != count) FailNode(path, node, "must have " + std::to_string(count) + " inputs");
}

/// Where the samples of one resized axis lie.
struct AxisSamples {
  Tensor low, high, weight;  // weight of `high`
};

AxisSamples SampleAxis(int64_t inputs, int64_t outputs, bool half_pixel, bool align_corners) {
  const double scale = align_corners && outputs > 1 ? static_cast<double>(inputs - 1) / static_cast<double>(outputs - 1)
                                                    : static_cast<double>(inputs) / static_cast<double>(outputs);
  AxisSamples axis{torch::empty({outputs}, torch::kLong), torch::empty({outputs}, torch::kLong), torch::empty({outputs})};
  for (int64_t i = 0; i < outputs; ++i) {
    const double at = half_pixel ? (static_cast<double>(i) + 0.5) * scale - 0.5 : static_cast<double>(i) * scale;
    const int64_t low = static_cast<int64_t>(std::floor(at));
    axis.low.data_ptr<int64_t>()[i] = std::clamp<int64_t>(low, 0, inputs - 1);
    axis.high.data_ptr<int64_t>()[i] = std::clamp<int64_t>(low + 1, 0, inputs - 1);
    axis.weight.data_ptr<float>()[i] = static_cast<float>(at - static_cast<double>(low));
  }
  return axis;
}

Tensor ResizeAxis(const Tensor& x, int64_t dim, const AxisSamples& axis) {
  std::vector<int64_t> shape(4, 1);
  shape[static_cast<size_t>(dim)] = axis.weight.size(0);
  const Tensor low = x.index_select(dim, axis.low);
  return low + (x.index_select(dim, axis.high) - low) * axis.weight.reshape(shape);
}

bool FlagOf(const TfNode& node, const std::string& key) {
  const auto found = node.attributes.find(key);
  return found != node.attributes.end() && found->second.flag;
}

Operation CompileSum(const std::string& path, const TfNode& node) {
  if (node.inputs.empty()) FailNode(path, node, "has no inputs");
  return [path, node](const std::vector<Tensor>& in) {
    Tensor sum = in[0];
    for (size_t i = 1; i < in.size(); ++i) {
      if (in[i].sizes() != sum.sizes()) FailNode(path, node, "its inputs have different shapes");
      sum = sum + in[i];
    }
    return sum;
  };
}

}  // namespace

void FailNode(const std::string& path, const TfNode& node, const std::string& what) {
  throw FormatError(path, NodeText(node.name) + " (" + node.op + ")", what);
}

Operation CompileResize(const std::string& path, const TfNode& node) {
  if (node.op != "ResizeBilinear") return {};
  CheckInputs(path, node, 2);
  const bool half_pixel = FlagOf(node, "half_pixel_centers"), align_corners = FlagOf(node, "align_corners");
  if (half_pixel && align_corners) FailNode(path, node, "half_pixel_centers and align_corners exclude each other");
  return [path, node, half_pixel, align_corners](const std::vector<Tensor>& in) {
    const bool shapes = in[0].dim() == 4 && in[1].dim() == 1 && in[1].size(0) == 2 && in[1].scalar_type() == torch::kInt;
    if (!shapes) FailNode(path, node, "needs an input of four dimensions and two sizes");
    const int64_t height = in[1][0].item<int>(), width = in[1][1].item<int>();
    if (height < 1 || width < 1) FailNode(path, node, "resizes to nothing");
    CountElements(path, NodeText(node.name), {in[0].size(0), height, width, in[0].size(3)});
    CountElements(path, NodeText(node.name), {in[0].size(0), height, in[0].size(2), in[0].size(3)});
    const Tensor tall = ResizeAxis(in[0], 1, SampleAxis(in[0].size(1), height, half_pixel, align_corners));
    return ResizeAxis(tall, 2, SampleAxis(in[0].size(2), width, half_pixel, align_corners));
  };
}

Operation CompilePad(const std::string& path, const TfNode& node) {
  if (node.op != "Pad") return {};
  CheckInputs(path, node, 2);
  return [path, node](const std::vector<Tensor>& in) {
    const Tensor &x = in[0], &sizes = in[1];
    const bool shapes =
        sizes.dim() == 2 && sizes.size(0) == x.dim() && sizes.size(1) == 2 && sizes.scalar_type() == torch::kInt;
    if (!shapes) FailNode(path, node, "needs two sizes for each dimension of its input");
    std::vector<int64_t> shape = x.sizes().vec(), last_first;
    for (int64_t d = x.dim() - 1; d >= 0; --d) {
      for (int64_t end = 0; end < 2; ++end) {
        const int64_t size = sizes[d][end].item<int>();
        if (size < 0) FailNode(path, node, "pads by a negative size");
        last_first.push_back(size), shape[static_cast<size_t>(d)] += size;
      }
    }
    CountElements(path, NodeText(node.name), shape);
    return torch::constant_pad_nd(x, last_first, 0);
  };
}

Operation CompileOperation(const std::string& path, const TfNode& node) {
  if (const Operation op = CompileConvolution(path, node)) return op;
  if (const Operation op = CompilePooling(path, node)) return op;
  if (const Operation op = CompileResize(path, node)) return op;
  if (const Operation op = CompilePad(path, node)) return op;
  if (node.op == "AddN") return CompileSum(path, node);
  if (const Binary binary = FindBinary(node.op)) {
    CheckInputs(path, node, 2);
    return [path, node, binary](const std::vector<Tensor>& in) {
      CheckBroadcast(path, node, in[0], in[1]);
      return binary(in[0], in[1]);
    };
  }
  if (const Unary unary = FindUnary(node.op)) {
    CheckInputs(path, node, 1);
    return [unary](const std::vector<Tensor>& in) { return unary(in[0]); };
  }
  throw FormatError(path, NodeText(node.name), "operation " + node.op + " is not known");
}

}  // namespace mvstudio::detect::internal
