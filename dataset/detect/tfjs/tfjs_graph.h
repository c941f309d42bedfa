#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace at {
class Tensor;
}

/// TensorFlow.js graph models: a JSON file with the graph and binary files with its weights, run on libtorch.
namespace mvstudio::detect {

/// An array of floats, row by row. Images are NHWC: (1, height, width, channels).
struct FloatTensor {
  std::vector<int64_t> shape;
  std::vector<float> values;
};

/// The files of one graph model. `path` is for messages only.
struct TfjsFiles {
  std::string path;
  std::string json;                           ///< the text of the JSON file
  std::map<std::string, std::string> shards;  ///< file name in `weightsManifest` -> content
};

struct TensorSpec {
  std::string name;
  std::vector<int64_t> shape;  ///< -1: any
};

/// A graph ready to run in float32. Immutable and deterministic: the same input and number of threads give the same numbers.
///
/// Operations: Conv2D, DepthwiseConv2dNative, their fused forms (BiasAdd, Relu, Relu6), Conv2DBackpropInput, AvgPool, MaxPool,
/// ResizeBilinear, Pad, Add, AddV2, AddN, BiasAdd, Sub, Mul, Relu, Relu6, Sigmoid, Identity, Const, Placeholder; all NHWC, with
/// TensorFlow's SAME (the odd row of padding below and right) or VALID. Weights: float32, int32, and those quantised to
/// float16, uint8 or uint16.
class TfjsGraph {
 public:
  /// `inputs` and `outputs` name nodes, possibly inner ones: only the part between them is read, checked and run. Empty:
  /// the graph's placeholders, and the outputs of its signature.
  ///
  /// Throws FormatError naming the node for an unknown operation, missing inputs, cycles, and inconsistent shapes,
  /// offsets, types or sizes.
  explicit TfjsGraph(const TfjsFiles& files, const std::vector<std::string>& inputs = {},
                     const std::vector<std::string>& outputs = {});
  ~TfjsGraph();
  TfjsGraph(TfjsGraph&&) noexcept;
  TfjsGraph& operator=(TfjsGraph&&) noexcept;

  const std::vector<TensorSpec>& inputs() const;
  const std::vector<std::string>& outputs() const;

  /// The outputs in the order of outputs(). Height and width may differ from the placeholder's where the graph allows it.
  /// Throws ContractViolation when `inputs` are not those of inputs(), or their rank, channels or number of values are
  /// wrong. Throws FormatError naming the node where a tensor does not fit an operation.
  std::vector<FloatTensor> Run(const std::vector<FloatTensor>& inputs) const;

  /// Same on libtorch's tensors, float32, with gradients with respect to the inputs.
  std::vector<at::Tensor> RunTensors(const std::vector<at::Tensor>& inputs) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Number of threads of all graphs of this process; 0: as many as the machine has. libtorch starts with one on some
/// machines.
void SetGraphThreads(int num_threads);

}  // namespace mvstudio::detect
