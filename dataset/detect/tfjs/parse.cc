#include <algorithm>

#include "dataset/detect/tfjs/json_parse.h"
#include "dataset/detect/tfjs/parsed_graph.h"
#include "dataset/detect/tfjs/weights.h"

namespace mvstudio::detect {
namespace internal {
namespace {

constexpr size_t kMaxNodes = 100000;

/// "name", "name:0" -> "name"; a further output "name:1" stays as it is; empty for a control input "^name".
std::string InputName(const JsonView& node, const std::string& text) {
  if (text.empty()) node.Fail("has an input without a name");
  if (text[0] == '^') return "";
  const size_t colon = text.rfind(':');
  return colon != std::string::npos && text.substr(colon) == ":0" ? text.substr(0, colon) : text;
}

std::vector<int64_t> ReadShape(const JsonView& shape) {
  std::vector<int64_t> dims;
  if (!shape.Has("dim")) return dims;
  const JsonView list = shape["dim"];
  if (list.ArraySize() > 8) list.Fail("has more than 8 dimensions");
  for (size_t i = 0; i < list.ArraySize(); ++i) dims.push_back(list[i]["size"].LongInt());
  return dims;
}

TfAttribute ReadAttribute(const JsonView& value) {
  TfAttribute attribute;
  const auto text = [&](const JsonView& view) { return DecodeBase64(value.path(), view.where(), view.Text()); };
  if (value.Has("b")) attribute.flag = value["b"].Flag();
  if (value.Has("i")) attribute.ints.push_back(value["i"].LongInt());
  if (value.Has("s")) attribute.texts.push_back(text(value["s"]));
  if (!value.Has("list")) return attribute;
  const JsonView list = value["list"];
  if (list.Has("i")) {
    for (size_t i = 0; i < list["i"].ArraySize(); ++i) attribute.ints.push_back(list["i"][i].LongInt());
  }
  if (list.Has("s")) {
    for (size_t i = 0; i < list["s"].ArraySize(); ++i) attribute.texts.push_back(text(list["s"][i]));
  }
  return attribute;
}

TfNode ReadNode(const JsonView& unnamed) {
  TfNode node;
  node.name = unnamed["name"].Text();
  const JsonView view = unnamed.Named(NodeText(node.name));
  node.op = view["op"].Text();
  if (view.Has("input")) {
    for (size_t i = 0; i < view["input"].ArraySize(); ++i) {
      const std::string name = InputName(view, view["input"][i].Text());
      if (!name.empty()) node.inputs.push_back(name);
    }
  }
  if (!view.Has("attr")) return node;
  const JsonView attributes = view["attr"];
  if (!attributes.value().is_object()) attributes.Fail("must be an object");
  for (const auto& [key, value] : attributes.value().items()) {
    if (key == "value" || key == "shape") continue;
    node.attributes[key] = ReadAttribute(JsonView(view.path(), value, attributes.where() + "." + key));
  }
  if (node.op == "Placeholder" && attributes.Has("shape")) node.shape = ReadShape(attributes["shape"]["shape"]);
  return node;
}

std::vector<std::string> ReadSignatureOutputs(const JsonView& root) {
  std::vector<std::string> names;
  if (!root.Has("signature") || !root["signature"].Has("outputs")) return names;
  const JsonView outputs = root["signature"]["outputs"];
  if (!outputs.value().is_object()) outputs.Fail("must be an object");
  for (const auto& [key, value] : outputs.value().items()) {
    const JsonView output(root.path(), value, "signature.outputs." + key);
    names.push_back(InputName(output, output["name"].Text()));
  }
  return names;
}

}  // namespace

int64_t CountElements(const std::string& path, const std::string& where, const std::vector<int64_t>& shape) {
  int64_t count = 1;
  for (const int64_t size : shape) {
    if (size < 0) throw FormatError(path, where, "has a negative dimension");
    if (size > kMaxElements || count * size > kMaxElements) {
      throw FormatError(path, where, "would have more than " + std::to_string(kMaxElements) + " elements");
    }
    count *= size;
  }
  return count;
}

TfGraph ParseTfjs(const TfjsFiles& files) {
  const Json json = ParseJson(files.path, files.json);
  const JsonView root(files.path, json);
  TfGraph graph;
  graph.path = files.path;
  const JsonView nodes = root["modelTopology"]["node"];
  if (nodes.ArraySize() > kMaxNodes) nodes.Fail("has more than " + std::to_string(kMaxNodes) + " nodes");
  for (size_t i = 0; i < nodes.ArraySize(); ++i) {
    graph.nodes.push_back(ReadNode(nodes[i]));
    const std::string& name = graph.nodes.back().name;
    if (!graph.by_name.emplace(name, i).second) throw FormatError(files.path, NodeText(name), "is there twice");
  }
  graph.weights = ReadWeights(root["weightsManifest"], files.shards);
  graph.signature_outputs = ReadSignatureOutputs(root);
  return graph;
}

std::vector<std::string> ShardNames(const std::string& path, const std::string& text) {
  const Json json = ParseJson(path, text);
  const JsonView groups = JsonView(path, json)["weightsManifest"];
  std::vector<std::string> names;
  for (size_t g = 0; g < groups.ArraySize(); ++g) {
    const JsonView paths = groups[g]["paths"];
    for (size_t i = 0; i < paths.ArraySize(); ++i) {
      const std::string name = paths[i].Text();
      const bool plain =
          !name.empty() && name != "." && name != ".." && name.find_first_of(std::string("/\\\0", 3)) == std::string::npos;
      if (!plain) paths[i].Fail("must be the name of a file beside the graph");
      names.push_back(name);
    }
  }
  return names;
}

std::vector<size_t> EvaluationOrder(const TfGraph& graph, const std::vector<std::string>& inputs,
                                    const std::vector<std::string>& outputs) {
  enum class Mark { kNew, kOpen, kDone };
  std::vector<Mark> marks(graph.nodes.size(), Mark::kNew);
  std::vector<size_t> order;
  std::vector<std::pair<size_t, size_t>> stack;  // node, next of its inputs: no recursion, the file may be hostile
  const auto find = [&](const std::string& name, const std::string& user) {
    const auto found = graph.by_name.find(name);
    if (found == graph.by_name.end())
      throw FormatError(graph.path, user, "needs '" + name + "', which is not there; only first outputs of nodes are known");
    return found->second;
  };
  const auto open = [&](size_t idx) {
    const TfNode& node = graph.nodes[idx];
    if (marks[idx] == Mark::kDone) return;
    if (marks[idx] == Mark::kOpen) throw FormatError(graph.path, NodeText(node.name), "needs its own output");
    marks[idx] = Mark::kOpen;
    const bool fed = std::find(inputs.begin(), inputs.end(), node.name) != inputs.end();
    stack.emplace_back(idx, fed ? node.inputs.size() : 0);
  };
  for (const std::string& output : outputs) {
    open(find(output, "outputs"));
    while (!stack.empty()) {
      auto& [idx, next] = stack.back();
      const TfNode& node = graph.nodes[idx];
      if (next < node.inputs.size()) {
        open(find(node.inputs[next++], NodeText(node.name)));
        continue;
      }
      marks[idx] = Mark::kDone;
      order.push_back(idx);
      stack.pop_back();
    }
  }
  return order;
}

}  // namespace internal

}  // namespace mvstudio::detect
