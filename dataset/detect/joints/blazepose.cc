#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "dataset/detect/joints/joint_net.h"
#include "dataset/detect/joints/net_values.h"
#include "dataset/detect/models/models.h"

namespace mvstudio::detect {

using dataset::Keypoint2d;

namespace {

const std::string kScope = "StatefulPartitionedCall/model/";
constexpr int kJoints = 33, kChannels = 39;  // six more are for cutting the next crop
constexpr int kValues = 5;                   // a landmark: x, y, z in the crop's pixels, logits of visibility and presence

/// BlazePose's landmarks: a regression, moved to the nearby mass of its heat maps as MediaPipe does.
class Blazepose : public JointNet {
 public:
  explicit Blazepose(const std::string& models_folder)
      : graph_(ReadModel("blazepose-full", models_folder), {"input_1"},
               {kScope + "convld_3d/BiasAdd", kScope + "activation_heatmap/Sigmoid", kScope + "activation_poseflag/Sigmoid"}) {}
  const geometry::Skeleton& skeleton() const override { return geometry::SkeletonByName("mediapipe33"); }
  int input_px() const override { return 256; }
  double person_fill() const override { return 0.75; }
  JointMaps Run(const Image& crop, const std::vector<Keypoint2d>& expected) const override;

 private:
  TfjsGraph graph_;
};

/// The mean of the heat map around a landmark, weighted by heat; the landmark itself where the map is cold.
Keypoint2d Refined(const Keypoint2d& landmark, const FloatTensor& heat, int joint, double stride_px) {
  constexpr int kReach = 3;           // cells
  constexpr double kLeastHeat = 0.5;  // both of MediaPipe's graph
  const int height = static_cast<int>(heat.shape[1]), width = static_cast<int>(heat.shape[2]);
  const int column = static_cast<int>(std::floor((landmark.x_px + 0.5) / stride_px));
  const int row = static_cast<int>(std::floor((landmark.y_px + 0.5) / stride_px));
  double sum = 0, sum_x = 0, sum_y = 0, highest = 0;
  for (int y = std::max(0, row - kReach); y <= std::min(height - 1, row + kReach); ++y) {
    for (int x = std::max(0, column - kReach); x <= std::min(width - 1, column + kReach); ++x) {
      const double value = heat.values[(static_cast<size_t>(y) * width + x) * kChannels + joint];
      sum += value, sum_x += value * x, sum_y += value * y, highest = std::max(highest, value);
    }
  }
  if (!(highest >= kLeastHeat)) return landmark;
  return {(sum_x / sum + 0.5) * stride_px - 0.5, (sum_y / sum + 0.5) * stride_px - 0.5, landmark.score};
}

/// Maps whose every cell points to the joint, and counts less the farther from it.
void AddJoint(const Keypoint2d& at, int joint, JointMaps* maps) {
  const double spread = 1.5 * maps->stride_px;
  for (int y = 0; y < maps->height; ++y) {
    for (int x = 0; x < maps->width; ++x) {
      const size_t cell = (static_cast<size_t>(joint) * maps->height + y) * maps->width + x;
      const double dx = at.x_px - maps->origin_x_px - x * maps->stride_px;
      const double dy = at.y_px - maps->origin_y_px - y * maps->stride_px;
      maps->score[cell] = static_cast<float>(at.score * std::exp(-(dx * dx + dy * dy) / (2 * spread * spread)));
      maps->dx_px[cell] = static_cast<float>(dx), maps->dy_px[cell] = static_cast<float>(dy);
    }
  }
}

JointMaps Blazepose::Run(const Image& crop, const std::vector<Keypoint2d>& /*expected*/) const {
  const std::vector<FloatTensor> out = graph_.Run({internal::ToUnit(crop)});
  const FloatTensor &landmarks = out[0], &heat = out[1];
  JointMaps maps;
  maps.joints = kJoints;
  maps.height = static_cast<int>(heat.shape[1]), maps.width = static_cast<int>(heat.shape[2]);
  maps.stride_px = static_cast<double>(input_px()) / maps.width;
  maps.origin_x_px = maps.origin_y_px = 0.5 * maps.stride_px - 0.5;
  const size_t cells = static_cast<size_t>(kJoints) * maps.height * maps.width;
  maps.score.resize(cells), maps.dx_px.resize(cells), maps.dy_px.resize(cells);
  const double person = out[2].values[0];
  for (int j = 0; j < kJoints; ++j) {
    const float* v = landmarks.values.data() + static_cast<size_t>(j) * kValues;
    const double score = person * internal::SigmoidOf(v[3]) * internal::SigmoidOf(v[4]);
    AddJoint(Refined({v[0] - 0.5, v[1] - 0.5, score}, heat, j, maps.stride_px), j, &maps);
  }
  return maps;
}

}  // namespace

std::unique_ptr<JointNet> OpenBlazepose(const std::string& models_folder) { return std::make_unique<Blazepose>(models_folder); }

}  // namespace mvstudio::detect
