#include "avatar/run/evaluate/posenet_features.h"

#include <ATen/ATen.h>

#include "core/hash/sha256.h"
#include "dataset/detect/models/models.h"
#include "dataset/detect/tfjs/tfjs_graph.h"

namespace mvstudio::avatar {
namespace {

std::string Pointwise(int number) { return "MobilenetV1/MobilenetV1/Conv2d_" + std::to_string(number) + "_pointwise/Relu6"; }

/// Of the graph and all its weights.
std::string DigestOf(const detect::TfjsFiles& files) {
  Sha256 digest;
  digest.Update(files.json.data(), files.json.size());
  for (const auto& [name, content] : files.shards) digest.Update(content.data(), content.size());
  return digest.HexDigest();
}

class PoseNet : public FeatureNet {
 public:
  explicit PoseNet(const std::string& folder)
      : files_(detect::ReadModel("posenet", folder)),
        levels_(files_, {}, {Pointwise(1), Pointwise(3), Pointwise(5), Pointwise(7)}),
        last_(files_, {}, {Pointwise(13)}),
        sha256_(DigestOf(files_)) {
    files_ = {};
  }

  std::string name() const override { return "posenet"; }
  std::string sha256() const override { return sha256_; }
  std::vector<at::Tensor> Levels(const at::Tensor& rgb) const override { return Call(levels_, rgb); }
  at::Tensor Pooled(const at::Tensor& rgb) const override { return Call(last_, rgb)[0].mean({2, 3}); }

 private:
  static std::vector<at::Tensor> Call(const detect::TfjsGraph& graph, const at::Tensor& rgb) {
    // The graph's weights stay on the CPU.
    std::vector<at::Tensor> levels = graph.RunTensors({(2 * rgb - 1).to(at::kCPU, at::kFloat).permute({0, 2, 3, 1})});
    for (at::Tensor& level : levels) level = level.permute({0, 3, 1, 2}).to(rgb.device());
    return levels;
  }

  detect::TfjsFiles files_;
  detect::TfjsGraph levels_, last_;
  std::string sha256_;
};

}  // namespace

std::shared_ptr<const FeatureNet> PoseNetFeatures(const std::string& folder) { return std::make_shared<PoseNet>(folder); }

std::shared_ptr<const FeatureNet> FeatureNetByName(const std::string& name, const std::string& models_folder) {
  if (name == "none") return nullptr;
  if (name == "posenet") return PoseNetFeatures(models_folder);
  if (name == "auto") return detect::HasModel("posenet", models_folder) ? PoseNetFeatures(models_folder) : nullptr;
  return LoadTorchScriptNet(name);
}

}  // namespace mvstudio::avatar
