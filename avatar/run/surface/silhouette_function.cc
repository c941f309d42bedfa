#include "avatar/run/surface/silhouette_function.h"

#include <algorithm>

#include "avatar/body/fit/posed_bones.h"

namespace mvstudio::avatar {
namespace {

using OffsetRows = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

double MaskShare(const Image& mask) {
  double sum = 0;
  for (const uint8_t value : mask.pixels) sum += value / 255.0;
  return std::max(sum, 1.0) / static_cast<double>(mask.pixels.size());
}

struct Loss {
  double value = 0;
  OffsetRows gradient;  // (V, 3) with respect to the offsets
};

Loss LossOf(const Eigen::Matrix3Xf& offsets, const SilhouetteViews& of) {
  const body::BodyTemplate moved = WithOffsets(of.take->body, offsets);
  const body::PosedBones bones(moved, of.step->seen);
  const Eigen::Matrix3Xf vertices = SkinVertices(moved, bones.pose());
  Eigen::Matrix3Xd in_world = Eigen::Matrix3Xd::Zero(3, offsets.cols());
  Loss loss{0, OffsetRows::Zero(offsets.cols(), 3)};
  for (const int k : of.views) {
    const body::FitView& view = of.step->step->views[k];
    const Image& mask = view.outline->mask();
    const double weight = 1 / (MaskShare(mask) * static_cast<double>(of.views.size()));
    const body::SilhouetteTerm term = body::SilhouetteLoss(moved.faces, vertices, view.camera, mask, of.options);
    loss.value += weight * term.loss, in_world += weight * term.gradient;
  }
  for (Eigen::Index v = 0; v < offsets.cols(); ++v) {
    if (in_world.col(v) != Eigen::Vector3d::Zero())
      loss.gradient.row(v) = (bones.VertexRotation(static_cast<int>(v)).transpose() * in_world.col(v)).cast<float>();
  }
  return loss;
}

struct SilhouetteFunction : torch::autograd::Function<SilhouetteFunction> {
  static at::Tensor forward(torch::autograd::AutogradContext* context, const at::Tensor& offsets,
                            const SilhouetteViews* views) {
    const at::Tensor plain = offsets.detach().contiguous();
    const Eigen::Map<const OffsetRows> rows(plain.data_ptr<float>(), plain.size(0), 3);
    const Loss loss = LossOf(rows.transpose(), *views);
    at::Tensor gradient = at::empty_like(plain);
    std::copy_n(loss.gradient.data(), loss.gradient.size(), gradient.data_ptr<float>());
    context->save_for_backward({gradient});
    return at::scalar_tensor(loss.value, at::kDouble);
  }
  static torch::autograd::tensor_list backward(torch::autograd::AutogradContext* context, torch::autograd::tensor_list outer) {
    return {outer[0] * context->get_saved_variables()[0], at::Tensor()};
  }
};

}  // namespace

at::Tensor SilhouetteOfOffsets(const at::Tensor& offsets, const SilhouetteViews& views) {
  return SilhouetteFunction::apply(offsets, &views);
}

}  // namespace mvstudio::avatar
