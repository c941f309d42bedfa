#include "avatar/run/surface/trained_net.h"

#include <cmath>

#include "core/random.h"

namespace mvstudio::avatar {
namespace {

using OffsetRows = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

at::Tensor Smoothed(const at::Tensor& raw, const body::OffsetSmoother& smoother) {
  const at::Tensor plain = raw.detach().contiguous();
  const OffsetRows smooth =
      smoother.Apply(Eigen::Map<const OffsetRows>(plain.data_ptr<float>(), plain.size(0), 3).transpose()).transpose();
  at::Tensor out = at::empty_like(plain);
  std::copy_n(smooth.data(), smooth.size(), out.data_ptr<float>());
  return out;
}

/// The smoother's matrix is symmetric: gradients go back through it as offsets go forward.
struct SmoothFunction : torch::autograd::Function<SmoothFunction> {
  static at::Tensor forward(torch::autograd::AutogradContext* context, const at::Tensor& raw,
                            const body::OffsetSmoother* smoother) {
    context->saved_data["smoother"] = reinterpret_cast<int64_t>(smoother);
    return Smoothed(raw, *smoother);
  }
  static torch::autograd::tensor_list backward(torch::autograd::AutogradContext* context, torch::autograd::tensor_list outer) {
    const auto* smoother = reinterpret_cast<const body::OffsetSmoother*>(context->saved_data["smoother"].toInt());
    return {Smoothed(outer[0], *smoother), at::Tensor()};
  }
};

at::Tensor FirstWeights(const std::string& name, const std::vector<int64_t>& shape, Rng* rng) {
  at::Tensor value = at::zeros(shape);
  const bool zero = shape.size() == 1 || name.rfind("head.", 0) == 0;
  const double inputs = static_cast<double>(value[0].numel());
  const double sigma = zero ? 0 : name == "geometry" ? 0.1 : std::sqrt(2 / inputs);
  for (int64_t i = 0; i < value.numel() && !zero; ++i) value.data_ptr<float>()[i] = static_cast<float>(sigma * rng->Normal());
  return value.requires_grad_();
}

at::Tensor RowsOf(const Eigen::MatrixXf& columns) {
  return at::from_blob(const_cast<float*>(columns.data()), {columns.cols(), columns.rows()}).clone();
}

/// (3, height, width) of a map (3, height * width).
at::Tensor MapTensor(const Eigen::Matrix3Xf& map) {
  return RowsOf(map).t().contiguous().view({3, body::OffsetAtlas::kHeight, body::OffsetAtlas::kWidth});
}

}  // namespace

TrainedNet::TrainedNet(const body::OffsetAtlas& atlas, const body::OffsetSmoother& smoother, const body::OffsetNetSizes& sizes,
                       const body::PositionNorm& norm, uint64_t seed)
    : atlas_(&atlas), smoother_(&smoother), norm_(norm), coordinates_(RowsOf(atlas.coordinates)) {
  grid_ = coordinates_.slice(1, 0, 2).contiguous().view({1, -1, 1, 2});
  Rng rng(seed);
  for (const auto& [name, shape] : OffsetNetShapes(sizes)) {
    if (name == "mean" || name == "spread") continue;
    parameters_.emplace_back(name, FirstWeights(name, shape, &rng));
    by_name_[name] = parameters_.back().second;
  }
}

at::Tensor TrainedNet::Convolve(const std::string& name, const at::Tensor& x, int stride) const {
  const at::Tensor weight = Of(name + ".weight");
  return at::conv2d(x, weight, Of(name + ".bias"), stride, stride == 2 ? 1 : weight.size(2) / 2);
}

at::Tensor TrainedNet::Linear(const std::string& name, const at::Tensor& x) const {
  return at::linear(x, Of(name + ".weight"), Of(name + ".bias"));
}

at::Tensor TrainedNet::Forward(const Eigen::Matrix3Xf& posed) const {
  at::Tensor x = MapTensor(NormalPositions(*atlas_, norm_, posed)).unsqueeze(0);
  x = at::relu(Convolve("stem", x, 1));
  std::vector<at::Tensor> levels;
  for (int level = 0; level < body::kOffsetNetDowns; ++level)
    levels.push_back(x), x = at::relu(Convolve("down" + std::to_string(level), x, 2));
  for (int level = body::kOffsetNetDowns - 1; level >= 0; --level) {
    x = at::upsample_nearest2d(x, {2 * x.size(2), 2 * x.size(3)});
    x = at::relu(Convolve("up" + std::to_string(level), at::cat({x, levels[level]}, 1), 1));
  }
  const at::Tensor maps = at::cat({at::tanh(Convolve("pose", x, 1)), Of("geometry").unsqueeze(0)}, 1);
  const at::Tensor sampled = at::grid_sampler(maps, grid_, 0, 1, false).squeeze(3).squeeze(0).t();  // bilinear
  const at::Tensor features = at::cat({sampled, coordinates_}, 1);
  at::Tensor y = features;
  for (int i = 0; i < body::kOffsetNetLayers; ++i) {
    if (i == body::kOffsetNetSkipAt) y = at::cat({y, features}, 1);
    y = at::leaky_relu(Linear("layer" + std::to_string(i), y), body::kOffsetNetLeak);
  }
  return SmoothFunction::apply(body::kOffsetNetMostM * at::tanh(Linear("head", y)), smoother_);
}

body::NetArrays TrainedNet::Arrays() const {
  body::NetArrays arrays;
  for (const auto& [name, value] : parameters_) {
    const at::Tensor plain = value.detach().contiguous();
    arrays[name] = {plain.sizes().vec(), {plain.data_ptr<float>(), plain.data_ptr<float>() + plain.numel()}};
  }
  const at::Tensor mean = MapTensor(norm_.mean);
  arrays["mean"] = {mean.sizes().vec(), {mean.data_ptr<float>(), mean.data_ptr<float>() + mean.numel()}};
  arrays["spread"] = {{1}, {norm_.spread}};
  return arrays;
}

}  // namespace mvstudio::avatar
