#include "avatar/nets/transfer.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "avatar/maps/template_maps.h"
#include "core/check.h"

namespace mvstudio::avatar {
namespace {

constexpr char kNetwork[] = "generator.";

/// Input channels in the order of the first layer: bones, template, the template's colours, earlier images.
std::array<int64_t, 4> InputBlocks(const ModelOptions& o) {
  const int64_t colours = CorrectsColours(o) ? 3 : 0;
  return {o.inputs, NumTemplateChannels(o) - colours, colours, NumPreviousChannels(o)};
}

bool Contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// The name in a network of method `from` of what is called `name` in one of method `to`.
std::string NameIn(std::string name, const ModelOptions& to, const ModelOptions& from) {
  const auto [first, second] = DecoderNames(to.method);
  const auto [from_first, from_second] = DecoderNames(from.method);
  for (const auto& [own, other] : {std::pair(first, from_first), std::pair(second, from_second)}) {
    const size_t at = name.find(own + ".");
    if (at != std::string::npos) return name.replace(at, own.size(), other);
  }
  return name;
}

/// "generator.stem.0.weight" -> "stem.0".
std::string LayerOf(const std::string& name) {
  const size_t begin = std::string(kNetwork).size();
  return name.substr(begin, name.rfind('.') - begin);
}

/// Weights (out, in, k, k) of the first layer of a network with the channels `to`.
at::Tensor ForChannels(const at::Tensor& weight, const std::array<int64_t, 4>& from, const std::array<int64_t, 4>& to,
                       const at::Tensor& like) {
  at::Tensor out = at::zeros_like(like);
  int64_t read = 0, write = 0;
  for (size_t b = 0; b < to.size(); ++b) {
    if (from[b] == to[b] && to[b] > 0) out.narrow(1, write, to[b]).copy_(weight.narrow(1, read, from[b]));
    read += from[b], write += to[b];
  }
  return out;
}

void Add(const std::string& layer, std::vector<std::string>* layers) {
  if (std::find(layers->begin(), layers->end(), layer) == layers->end()) layers->push_back(layer);
}

}  // namespace

StartNetwork StartFrom(const AvatarModel& from, const ModelOptions& options, int size_px, uint64_t seed) {
  StartNetwork start;
  const bool same = from.options.method == options.method;
  const TensorFile source = ModelToTensors(from);
  TensorFile fresh = ModelToTensors(MakeModel(options, size_px, from.depth, seed));
  const std::array<int64_t, 4> from_blocks = InputBlocks(from.options), blocks = InputBlocks(options);
  for (auto& [name, tensor] : fresh.tensors) {
    if (name.rfind(kNetwork, 0) != 0) continue;
    const auto found = source.tensors.find(NameIn(name, options, from.options));
    const bool head = Contains(name, "decoder.head.");
    if (!same && head) {
      Add(LayerOf(name), &start.fresh);
      continue;
    }
    MVS_CHECK(found != source.tensors.end(), name << " is not in the network that is taken over");
    const bool other_inputs = Contains(name, ".stem.") && tensor.dim() == 4 && blocks != from_blocks;
    if (other_inputs) {
      tensor = ForChannels(found->second, from_blocks, blocks, tensor);
    } else {
      MVS_CHECK(found->second.sizes() == tensor.sizes(), name << " has another shape in the network that is taken over");
      tensor = found->second;
    }
    Add(LayerOf(name), other_inputs ? &start.partly : &start.taken);
  }
  start.model = ModelFromTensors(fresh, "transfer");
  start.initialised = same || options.method != Method::kTna;
  return start;
}

}  // namespace mvstudio::avatar
