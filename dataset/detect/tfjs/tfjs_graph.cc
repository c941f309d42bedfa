#include "dataset/detect/tfjs/tfjs_graph.h"

#include <algorithm>
#include <mutex>
#include <thread>

#include "dataset/detect/tfjs/ops.h"
// torch has macros of its own
#include "core/check.h"

namespace mvstudio::detect {

using internal::NodeText;
using internal::TfNode;
using torch::Tensor;

namespace {

/// One node to run: its result goes to a slot, its inputs come from slots.
struct Step {
  TfNode node;  // without its inputs' names
  internal::Operation operation;
  std::vector<size_t> inputs;
  std::vector<size_t> last_uses;  // slots that nothing needs afterwards
  size_t output = 0;
};

Tensor ConstantOf(const internal::TfGraph& graph, const TfNode& node) {
  const auto found = graph.weights.find(node.name);
  if (found == graph.weights.end()) throw FormatError(graph.path, NodeText(node.name), "has no weight in the manifest");
  const internal::TfWeight& weight = found->second;
  const auto type = weight.is_int ? torch::kInt : torch::kFloat;
  Tensor constant = torch::empty(weight.shape, type);
  if (weight.is_int) std::copy(weight.ints.begin(), weight.ints.end(), constant.data_ptr<int32_t>());
  if (!weight.is_int) std::copy(weight.floats.begin(), weight.floats.end(), constant.data_ptr<float>());
  return constant;
}

Tensor ToTorch(const FloatTensor& input, const TensorSpec& spec) {
  const bool fits = spec.shape.empty() || (input.shape.size() == spec.shape.size() &&
                                           (spec.shape.back() < 0 || spec.shape.back() == input.shape.back()));
  MVS_CHECK(fits, "rank or channels of input " << spec.name);
  const int64_t count = internal::CountElements(spec.name, "input", input.shape);
  MVS_CHECK(count == static_cast<int64_t>(input.values.size()) && count > 0, "values of input " << spec.name);
  Tensor tensor = torch::empty(input.shape, torch::kFloat);
  std::copy(input.values.begin(), input.values.end(), tensor.data_ptr<float>());
  return tensor;
}

FloatTensor FromTorch(const Tensor& tensor) {
  const Tensor plain = tensor.to(torch::kFloat).contiguous();
  FloatTensor output{plain.sizes().vec(), {}};
  output.values.assign(plain.data_ptr<float>(), plain.data_ptr<float>() + plain.numel());
  return output;
}

}  // namespace

struct TfjsGraph::Impl {
  std::string path;
  std::vector<TensorSpec> inputs;
  std::vector<std::string> outputs;
  std::vector<Tensor> constants;     // by slot; undefined for what is computed
  std::vector<size_t> input_slots;   // by input
  std::vector<size_t> output_slots;  // by output
  std::vector<Step> steps;

  void Build(const internal::TfGraph& graph, std::vector<std::string> input_names);
  void AddStep(const internal::TfGraph& graph, const TfNode& node, const std::map<std::string, size_t>& slots, size_t slot);
  void MarkLastUses();
  Tensor RunStep(const Step& step, const std::vector<Tensor>& values) const;
};

void TfjsGraph::Impl::AddStep(const internal::TfGraph& graph, const TfNode& node, const std::map<std::string, size_t>& slots,
                              size_t slot) {
  Step step;
  step.operation = internal::CompileOperation(graph.path, node);
  for (const std::string& name : node.inputs) step.inputs.push_back(slots.at(name));
  step.node.name = node.name;
  step.node.op = node.op;
  step.output = slot;
  steps.push_back(std::move(step));
}

void TfjsGraph::Impl::Build(const internal::TfGraph& graph, std::vector<std::string> input_names) {
  path = graph.path;
  if (outputs.empty()) outputs = graph.signature_outputs;
  if (outputs.empty()) throw FormatError(path, "signature.outputs", "names no output");
  const std::vector<size_t> order = internal::EvaluationOrder(graph, input_names, outputs);
  const bool placeholders = input_names.empty();
  std::map<std::string, size_t> slots;
  for (const size_t idx : order) {
    const TfNode& node = graph.nodes[idx];
    const size_t slot = slots.size();
    slots[node.name] = slot;
    constants.emplace_back();
    if (placeholders && node.op == "Placeholder") input_names.push_back(node.name);
    if (std::find(input_names.begin(), input_names.end(), node.name) != input_names.end()) continue;
    if (node.op == "Placeholder") throw FormatError(path, NodeText(node.name), "is a further input of these outputs");
    if (node.op == "Const") {
      constants[slot] = ConstantOf(graph, node);
    } else {
      AddStep(graph, node, slots, slot);
    }
  }
  for (const std::string& name : input_names) {
    if (!slots.count(name)) throw FormatError(path, NodeText(name), "is no input of these outputs");
    inputs.push_back({name, graph.nodes[graph.by_name.at(name)].shape});
    input_slots.push_back(slots[name]);
  }
  for (const std::string& name : outputs) output_slots.push_back(slots[name]);
  MarkLastUses();
}

void TfjsGraph::Impl::MarkLastUses() {
  std::map<size_t, size_t> last;  // slot -> step
  for (size_t s = 0; s < steps.size(); ++s) {
    for (const size_t slot : steps[s].inputs) last[slot] = s;
  }
  for (const auto& [slot, s] : last) {
    const bool keep = constants[slot].defined() || std::count(output_slots.begin(), output_slots.end(), slot) > 0;
    if (!keep) steps[s].last_uses.push_back(slot);
  }
}

Tensor TfjsGraph::Impl::RunStep(const Step& step, const std::vector<Tensor>& values) const {
  std::vector<Tensor> arguments;
  for (const size_t slot : step.inputs) arguments.push_back(values[slot]);
  try {
    return step.operation(arguments);
  } catch (const c10::Error& error) {
    throw FormatError(path, NodeText(step.node.name) + " (" + step.node.op + ")", error.what_without_backtrace());
  }
}

TfjsGraph::TfjsGraph(const TfjsFiles& files, const std::vector<std::string>& inputs, const std::vector<std::string>& outputs)
    : impl_(std::make_unique<Impl>()) {
  impl_->outputs = outputs;
  impl_->Build(internal::ParseTfjs(files), inputs);
}

TfjsGraph::~TfjsGraph() = default;
TfjsGraph::TfjsGraph(TfjsGraph&&) noexcept = default;
TfjsGraph& TfjsGraph::operator=(TfjsGraph&&) noexcept = default;

const std::vector<TensorSpec>& TfjsGraph::inputs() const { return impl_->inputs; }
const std::vector<std::string>& TfjsGraph::outputs() const { return impl_->outputs; }

std::vector<FloatTensor> TfjsGraph::Run(const std::vector<FloatTensor>& inputs) const {
  MVS_CHECK(inputs.size() == impl_->inputs.size(), inputs.size() << " inputs");
  const torch::NoGradGuard no_gradients;
  std::vector<Tensor> tensors;
  for (size_t i = 0; i < inputs.size(); ++i) tensors.push_back(ToTorch(inputs[i], impl_->inputs[i]));
  std::vector<FloatTensor> outputs;
  for (const Tensor& output : RunTensors(tensors)) outputs.push_back(FromTorch(output));
  return outputs;
}

std::vector<Tensor> TfjsGraph::RunTensors(const std::vector<Tensor>& inputs) const {
  MVS_CHECK(inputs.size() == impl_->inputs.size(), inputs.size() << " inputs");
  std::vector<Tensor> values = impl_->constants;
  for (size_t i = 0; i < inputs.size(); ++i) values[impl_->input_slots[i]] = inputs[i];
  for (const Step& step : impl_->steps) {
    values[step.output] = impl_->RunStep(step, values);
    for (const size_t slot : step.last_uses) values[slot] = Tensor();
  }
  std::vector<Tensor> outputs;
  for (const size_t slot : impl_->output_slots) outputs.push_back(values[slot]);
  return outputs;
}

void SetGraphThreads(int num_threads) {
  const int available = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  at::set_num_threads(num_threads > 0 ? num_threads : available);
}

}  // namespace mvstudio::detect
