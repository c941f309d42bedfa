// Private: what a TfjsGraph is made of, for the .cc files of detect/.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/detect/tfjs/tfjs_graph.h"

/// A TensorFlow.js graph as parsed from its files, before execution.
namespace mvstudio::detect::internal {

/// Largest number of elements of any tensor: 1 GiB of floats.
inline constexpr int64_t kMaxElements = int64_t{1} << 28;

/// One attribute of a node; only the members of its kind are set.
struct TfAttribute {
  std::vector<int64_t> ints;
  std::vector<std::string> texts;  // decoded
  bool flag = false;
};

struct TfNode {
  std::string name, op;
  std::vector<std::string> inputs;  // node names, without control inputs
  std::map<std::string, TfAttribute> attributes;
  std::vector<int64_t> shape;  // of a Placeholder
};

struct TfWeight {
  std::vector<int64_t> shape;
  std::vector<float> floats;  // dtype float32
  std::vector<int32_t> ints;  // dtype int32
  bool is_int = false;
};

struct TfGraph {
  std::string path;
  std::vector<TfNode> nodes;
  std::map<std::string, size_t> by_name;
  std::map<std::string, TfWeight> weights;
  std::vector<std::string> signature_outputs;  // node names
};

/// Throws FormatError for any inconsistency.
TfGraph ParseTfjs(const TfjsFiles& files);

/// Names of the weight files that the graph's manifest lists.
std::vector<std::string> ShardNames(const std::string& path, const std::string& json);

/// Indices of the nodes that `outputs` depend on, each after its inputs; the search stops at `inputs`. Throws FormatError
/// for missing nodes and cycles.
std::vector<size_t> EvaluationOrder(const TfGraph& graph, const std::vector<std::string>& inputs,
                                    const std::vector<std::string>& outputs);

/// Number of elements. Throws FormatError when a dimension is negative or the product exceeds kMaxElements.
int64_t CountElements(const std::string& path, const std::string& where, const std::vector<int64_t>& shape);

inline std::string NodeText(const std::string& name) { return "node '" + name + "'"; }

}  // namespace mvstudio::detect::internal
