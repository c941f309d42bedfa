#include "avatar/feature_net.h"

#include <torch/script.h>

#include <filesystem>

#include "core/error.h"

namespace mvstudio::avatar {
namespace {

class TorchScriptNet : public FeatureNet {
 public:
  explicit TorchScriptNet(const std::string& path) : path_(path) {
    if (!std::filesystem::exists(path)) throw IoError(path, "no such file");
    try {
      module_ = torch::jit::load(path, at::kCPU);
      module_.eval();
    } catch (const c10::Error& error) {
      throw FormatError(path, "", "is not a TorchScript file (" + error.msg().substr(0, error.msg().find('\n')) + ")");
    }
  }

  std::string name() const override { return std::filesystem::path(path_).filename().string(); }

  std::vector<at::Tensor> Levels(const at::Tensor& rgb) const override {
    std::vector<at::Tensor> levels;
    const c10::IValue output = Call(rgb);
    if (output.isTensor()) {
      levels = {output.toTensor()};
    } else if (output.isTensorList()) {
      levels = output.toTensorVector();
    } else if (output.isTuple()) {
      for (const c10::IValue& value : output.toTupleRef().elements()) {
        if (!value.isTensor()) throw FormatError(path_, "", "returns a tuple that holds something else than tensors");
        levels.push_back(value.toTensor());
      }
    }
    if (levels.empty()) throw FormatError(path_, "", "returns no tensor");
    return levels;
  }

 private:
  c10::IValue Call(const at::Tensor& rgb) const {
    try {
      return module_.get_method("forward")({rgb});
    } catch (const std::exception& error) {
      const std::string text = error.what();
      throw FormatError(path_, "forward", "cannot take pictures (B, 3, H, W): " + text.substr(0, text.find('\n')));
    }
  }

  std::string path_;
  mutable torch::jit::Module module_;
};

}  // namespace

at::Tensor FeatureNet::Pooled(const at::Tensor& rgb) const {
  const at::Tensor last = Levels(rgb).back();
  return last.dim() == 4 ? last.mean({2, 3}) : last.flatten(1);
}

std::shared_ptr<const FeatureNet> LoadTorchScriptNet(const std::string& path) { return std::make_shared<TorchScriptNet>(path); }

at::Tensor PerceptualLoss(const FeatureNet& net, const at::Tensor& a, const at::Tensor& b) {
  std::vector<at::Tensor> of_b;
  {
    const at::NoGradGuard no_gradients;
    of_b = net.Levels(b.detach());
  }
  const std::vector<at::Tensor> of_a = net.Levels(a);
  at::Tensor sum;
  for (size_t i = 0; i < of_a.size(); ++i) {
    const at::Tensor loss = (of_a[i] - of_b[i]).abs().mean();
    sum = sum.defined() ? sum + loss : loss;
  }
  return sum / static_cast<double>(of_a.size());
}

}  // namespace mvstudio::avatar
