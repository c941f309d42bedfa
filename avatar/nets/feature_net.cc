#include "avatar/nets/feature_net.h"

#include <torch/script.h>

#include <filesystem>
#include <unordered_map>

#include "core/error.h"
#include "core/hash/sha256.h"

namespace mvstudio::avatar {
namespace {

constexpr char kReturnFeatures[] = "return_features";

std::string FirstLine(const std::string& text) { return text.substr(0, text.find('\n')); }

/// A TorchScript file whose errors name it.
class Script {
 public:
  explicit Script(const std::string& path) : path_(path) {
    if (!std::filesystem::is_regular_file(path)) throw IoError(path, "no such file");
    try {
      module_ = torch::jit::load(path, at::kCPU);
      module_.eval();
      for (const at::Tensor& weight : module_.parameters()) at::Tensor(weight).requires_grad_(false);
      module_.get_method("forward");
    } catch (const c10::Error& error) {
      throw FormatError(path, "", "is not a TorchScript file (" + FirstLine(error.msg()) + ")");
    }
    sha256_ = Sha256File(path);
  }

  const std::string& path() const { return path_; }
  const std::string& sha256() const { return sha256_; }
  std::string name() const { return std::filesystem::path(path_).filename().string(); }

  bool TakesArgument(const std::string& name) const {
    return module_.get_method("forward").function().getSchema().argumentIndexWithName(name).has_value();
  }

  c10::IValue Call(const std::vector<c10::IValue>& inputs, const std::unordered_map<std::string, c10::IValue>& named,
                   const char* takes) const {
    try {
      const at::Device device = inputs.at(0).toTensor().device();
      if (device != device_) module_.to(device), device_ = device;
      return module_.get_method("forward")(inputs, named);
    } catch (const std::exception& error) {
      throw FormatError(path_, "forward", std::string("cannot take ") + takes + ": " + FirstLine(error.what()));
    }
  }

 private:
  std::string path_, sha256_;
  mutable torch::jit::Module module_;
  mutable at::Device device_{at::kCPU};  // follows what it is given
};

class TorchScriptNet : public FeatureNet {
 public:
  explicit TorchScriptNet(const std::string& path) : script_(path), detector_(script_.TakesArgument(kReturnFeatures)) {}

  std::string name() const override { return script_.name(); }
  std::string sha256() const override { return script_.sha256(); }

  std::vector<at::Tensor> Levels(const at::Tensor& rgb) const override {
    if (detector_) return {Features(255 * rgb)};
    std::vector<at::Tensor> levels;
    const c10::IValue output = script_.Call({rgb}, {}, "images (B, 3, H, W)");
    if (output.isTensor()) {
      levels = {output.toTensor()};
    } else if (output.isTensorList()) {
      levels = output.toTensorVector();
    } else if (output.isTuple()) {
      for (const c10::IValue& value : output.toTupleRef().elements()) {
        if (!value.isTensor()) throw FormatError(script_.path(), "", "returns a tuple that holds something else than tensors");
        levels.push_back(value.toTensor());
      }
    }
    if (levels.empty()) throw FormatError(script_.path(), "", "returns no tensor");
    return levels;
  }

  at::Tensor Pooled(const at::Tensor& rgb) const override {
    const at::Tensor rows = detector_ ? Features((255 * rgb).round().clamp(0, 255).to(at::kByte)) : LastOf(rgb.to(at::kFloat));
    if (rows.dim() != 2 || rows.size(0) != rgb.size(0) || rows.size(1) < 1)
      throw FormatError(script_.path(), "forward", "does not give one row of features an image");
    if (!at::isfinite(rows).all().item<bool>()) throw FormatError(script_.path(), "forward", "gives NaN or infinity");
    return rows;
  }

 private:
  at::Tensor Features(const at::Tensor& levels) const {
    const c10::IValue output = script_.Call({levels}, {{kReturnFeatures, true}}, "images (B, 3, H, W) of 0 to 255");
    if (!output.isTensor()) throw FormatError(script_.path(), "forward", "returns no tensor with return_features");
    return output.toTensor().flatten(1);
  }

  /// As FeatureNet::Pooled, which needs at least a row an image.
  at::Tensor LastOf(const at::Tensor& rgb) const {
    const at::Tensor last = Levels(rgb).back();
    return last.dim() == 4 ? last.mean({2, 3}) : last.dim() > 1 ? last.flatten(1) : last;
  }

  Script script_;
  bool detector_;
};

class TorchScriptDistance : public ImageDistance {
 public:
  explicit TorchScriptDistance(const std::string& path) : script_(path) {}

  std::string name() const override { return script_.name(); }
  std::string sha256() const override { return script_.sha256(); }

  at::Tensor operator()(const at::Tensor& a, const at::Tensor& b) const override {
    const at::NoGradGuard no_gradients;
    const c10::IValue output =
        script_.Call({(2 * a - 1).to(at::kFloat), (2 * b - 1).to(at::kFloat)}, {}, "two sets of images (B, 3, H, W)");
    if (!output.isTensor() || output.toTensor().numel() != a.size(0))
      throw FormatError(script_.path(), "forward", "does not give one number an image");
    const at::Tensor values = output.toTensor().flatten().to(at::kDouble);
    if (!at::isfinite(values).all().item<bool>()) throw FormatError(script_.path(), "forward", "gives NaN or infinity");
    return values;
  }

 private:
  Script script_;
};

}  // namespace

namespace {

/// Mean of a level by the weights of the pixels below; of one that has no place in the image the plain mean.
at::Tensor WeightedMean(const at::Tensor& level, const at::Tensor& weights) {
  if (level.dim() != 4) return level.mean();
  const at::Tensor of_level = at::adaptive_avg_pool2d(weights, {level.size(2), level.size(3)});
  const double pixels_each = static_cast<double>(weights.size(2) * weights.size(3)) / (level.size(2) * level.size(3));
  return pixels_each * (level.mean(1, true) * of_level).sum();
}

}  // namespace

at::Tensor FeatureNet::Pooled(const at::Tensor& rgb) const {
  const at::Tensor last = Levels(rgb).back();
  return last.dim() == 4 ? last.mean({2, 3}) : last.flatten(1);
}

std::shared_ptr<const FeatureNet> LoadTorchScriptNet(const std::string& path) { return std::make_shared<TorchScriptNet>(path); }

std::shared_ptr<const ImageDistance> LoadImageDistance(const std::string& path) {
  return std::make_shared<TorchScriptDistance>(path);
}

std::string DistanceName(const std::string& features, const std::string& sha256) {
  return sha256 == kInceptionSha256 ? "FID" : "FD (" + features + ")";
}

at::Tensor PerceptualLoss(const FeatureNet& net, const at::Tensor& a, const at::Tensor& b, const at::Tensor& weights) {
  std::vector<at::Tensor> of_b;
  {
    const at::NoGradGuard no_gradients;
    of_b = net.Levels(b.detach());
  }
  const std::vector<at::Tensor> of_a = net.Levels(a);
  at::Tensor sum;
  for (size_t i = 0; i < of_a.size(); ++i) {
    const at::Tensor loss = WeightedMean((of_a[i] - of_b[i]).abs(), weights);
    sum = sum.defined() ? sum + loss : loss;
  }
  return sum / static_cast<double>(of_a.size());
}

}  // namespace mvstudio::avatar
