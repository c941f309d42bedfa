#include <cmath>

#include "dataset/detect/joints/joint_net.h"
#include "dataset/detect/joints/net_values.h"
#include "dataset/detect/models/models.h"

namespace mvstudio::detect {
namespace {

const std::string kScope = "StatefulPartitionedCall/";

/// MoveNet's heads, without the choice of one person that its graph ends with.
class Movenet : public JointNet {
 public:
  explicit Movenet(const std::string& models_folder)
      : graph_(ReadModel("movenet-thunder", models_folder), {kScope + "sub_1"},
               {kScope + "kpt_heatmap_0/conv2d_5/BiasAdd", kScope + "kpt_offset_0/conv2d_7/BiasAdd",
                kScope + "center_0/conv2d_4/BiasAdd", kScope + "kpt_regress_0/conv2d_6/BiasAdd"}) {}
  const geometry::Skeleton& skeleton() const override { return geometry::SkeletonByName("coco17"); }
  int input_px() const override { return 256; }
  double person_fill() const override { return 0.75; }
  JointMaps Run(const Image& crop, const std::vector<dataset::Keypoint2d>& expected) const override;

 private:
  TfjsGraph graph_;
};

/// The cell that is the middle of a person and near the middle of the crop.
size_t CentreCell(const FloatTensor& centre, int height, int width) {
  size_t best = 0;
  double highest = -1;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const size_t cell = static_cast<size_t>(y) * width + x;
      const double off = std::hypot(y - 0.5 * (height - 1), x - 0.5 * (width - 1));
      const double score = internal::SigmoidOf(centre.values[cell]) / (off + 0.1 * width);
      if (score > highest) highest = score, best = cell;
    }
  }
  return best;
}

JointMaps Movenet::Run(const Image& crop, const std::vector<dataset::Keypoint2d>& /*expected*/) const {
  const std::vector<FloatTensor> out = graph_.Run({internal::ToSymmetric(crop)});
  JointMaps maps;
  maps.joints = 17;
  maps.height = static_cast<int>(out[0].shape[1]);
  maps.width = static_cast<int>(out[0].shape[2]);
  maps.stride_px = static_cast<double>(input_px()) / maps.width;
  maps.origin_x_px = maps.origin_y_px = -0.5;  // cells are counted from the image's corner
  const size_t cells = static_cast<size_t>(maps.height) * maps.width;
  const auto stride = static_cast<float>(maps.stride_px);
  maps.score.resize(17 * cells), maps.dx_px.resize(17 * cells), maps.dy_px.resize(17 * cells);
  for (size_t cell = 0; cell < cells; ++cell) {
    for (size_t j = 0; j < 17; ++j) {
      maps.score[j * cells + cell] = internal::SigmoidOf(out[0].values[cell * 17 + j]);
      maps.dy_px[j * cells + cell] = stride * out[1].values[cell * 34 + 2 * j];
      maps.dx_px[j * cells + cell] = stride * out[1].values[cell * 34 + 2 * j + 1];
    }
  }
  const size_t centre = CentreCell(out[2], maps.height, maps.width);
  for (size_t j = 0; j < 17; ++j) {
    const float y = static_cast<float>(centre / static_cast<size_t>(maps.width)) + out[3].values[centre * 34 + 2 * j];
    const float x = static_cast<float>(centre % static_cast<size_t>(maps.width)) + out[3].values[centre * 34 + 2 * j + 1];
    maps.prior_y_px.push_back(stride * y + static_cast<float>(maps.origin_x_px));
    maps.prior_x_px.push_back(stride * x + static_cast<float>(maps.origin_x_px));
  }
  maps.prior_scale_px = 1.8 * maps.stride_px;  // of MoveNet's own decoder
  return maps;
}

}  // namespace

std::unique_ptr<JointNet> OpenMovenet(const std::string& models_folder) { return std::make_unique<Movenet>(models_folder); }

}  // namespace mvstudio::detect
