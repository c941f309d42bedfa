#include "dataset/detect/models/npm_package.h"
#include "dataset/detect/tfjs/parsed_graph.h"
#include "tests/fuzz/fuzz.h"

/// Network files: the TensorFlow.js graph with its weights, and the archive that models come in. Nothing is run here.
namespace mvstudio::fuzz {

MVS_FUZZ_TARGET(tfjs_graph, bytes) {
  const auto parts = Parts(bytes, 2);
  detect::TfjsFiles files;
  files.path = "model.json";
  files.json = std::string(parts[0]);
  Accepts([&] {
    for (const std::string& name : detect::internal::ShardNames(files.path, files.json)) {
      Require(name.find('/') == std::string::npos && name != "..", "a weight file outside the folder");
      files.shards[name] = std::string(parts[1]);
    }
  });
  Accepts([&] {
    const detect::internal::TfGraph graph = detect::internal::ParseTfjs(files);
    detect::internal::EvaluationOrder(graph, {}, graph.signature_outputs);
  });
}

MVS_FUZZ_TARGET(model_archive, bytes) {
  constexpr size_t kMaxBytes = 1 << 20;
  Accepts([&] {
    const auto files = detect::internal::ExtractFiles("models.tgz", std::string(bytes), {"package/a.json"}, kMaxBytes);
    for (const auto& [name, content] : files) Require(content.size() <= kMaxBytes, "a file larger than the limit");
  });
}

}  // namespace mvstudio::fuzz
