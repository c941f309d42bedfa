#include "dataset/detect/joints/posenet.h"

#include <cmath>

#include "core/error.h"
#include "dataset/detect/joints/joint_net.h"
#include "dataset/detect/joints/net_values.h"
#include "dataset/detect/models/models.h"

namespace mvstudio::detect {
namespace internal {
namespace {

const std::string kScope = "MobilenetV1/";

FloatTensor Scaled(const Image& rgb, float factor, float offset) {
  FloatTensor tensor{{1, rgb.height, rgb.width, 3}, {}};
  tensor.values.reserve(rgb.pixels.size());
  for (const uint8_t value : rgb.pixels) tensor.values.push_back(static_cast<float>(value) * factor + offset);
  return tensor;
}

}  // namespace

FloatTensor ToSymmetric(const Image& rgb) { return Scaled(rgb, 1 / 127.5f, -1); }
FloatTensor ToUnit(const Image& rgb) { return Scaled(rgb, 1 / 255.0f, 0); }

float SigmoidOf(float x) { return 1.0f / (1.0f + std::exp(-x)); }

PosenetGraph::PosenetGraph(const std::string& models_folder)
    : graph_(ReadModel("posenet", models_folder), {},
             {kScope + "heatmap_2/BiasAdd", kScope + "offset_2/BiasAdd", kScope + "displacement_fwd_2/BiasAdd",
              kScope + "displacement_bwd_2/BiasAdd"}) {}

PosenetOutputs PosenetGraph::Run(const Image& rgb) const {
  std::vector<FloatTensor> out = graph_.Run({ToSymmetric(rgb)});
  PosenetOutputs outputs{std::move(out[0]), std::move(out[1]), std::move(out[2]), std::move(out[3])};
  for (float& value : outputs.heat.values) value = SigmoidOf(value);
  return outputs;
}

}  // namespace internal

namespace {

constexpr double kSeen = 0.1;  // score of a joint that counts

class Posenet : public JointNet {
 public:
  Posenet(const std::string& models_folder, int input_px) : graph_(models_folder), input_px_(input_px) {
    if (input_px % internal::kPosenetStride != 1) throw UsageError("posenet's crop must have 16 n + 1 pixels");
  }
  const geometry::Skeleton& skeleton() const override { return geometry::SkeletonByName("coco17"); }
  int input_px() const override { return input_px_; }
  double person_fill() const override { return 0.7; }
  JointMaps Run(const Image& crop, const std::vector<dataset::Keypoint2d>& expected) const override;

 private:
  internal::PosenetGraph graph_;
  int input_px_;
};

/// Mean distance of the joints from those expected, at most `limit` each; of the middles of the crop when nothing is.
double DistanceFrom(const std::vector<dataset::Keypoint2d>& expected, const dataset::Person2d& person, int crop_px,
                    double limit) {
  double sum = 0;
  int count = 0;
  for (size_t j = 0; j < expected.size(); ++j) {
    const dataset::Keypoint2d &a = expected[j], &b = person.keypoints[j];
    if (a.score < kSeen) continue;
    sum += std::min(limit, std::hypot(a.x_px - b.x_px, a.y_px - b.y_px));
    ++count;
  }
  if (count > 0) return sum / count;
  const Crop around = CropAround(person, 1, kSeen);
  return std::min(limit, std::hypot(around.x_px - 0.5 * crop_px, around.y_px - 0.5 * crop_px));
}

/// A joint that is far from where it is expected, and not much surer than it was there.
bool Doubtful(const dataset::Keypoint2d& joint, const dataset::Keypoint2d& expected, double scale_px) {
  constexpr double kSurer = 1.5;
  const double off = std::hypot(joint.x_px - expected.x_px, joint.y_px - expected.y_px);
  return off > scale_px && joint.score < kSurer * expected.score;
}

/// The person that is expected says where to look for joints: other people may be in the crop.
void AddPrior(const internal::PosenetOutputs& outputs, int crop_px, const std::vector<dataset::Keypoint2d>& expected,
              JointMaps* maps) {
  const double limit = 0.3 * crop_px;
  const dataset::Person2d* likely = nullptr;
  double best = 0;
  const std::vector<CoarsePerson> people = internal::DecodePeople(outputs);
  for (const CoarsePerson& person : people) {
    const double off = DistanceFrom(expected, person.pose, crop_px, limit) / (0.4 * limit);
    const double weight = person.score * std::exp(-off * off);
    if (weight > best) best = weight, likely = &person.pose;
  }
  const double scale = 0.12 * crop_px;
  for (size_t j = 0; likely ? j < likely->keypoints.size() : j < expected.size(); ++j) {
    const bool known =
        j < expected.size() && (!likely || (expected[j].score >= kSeen && Doubtful(likely->keypoints[j], expected[j], scale)));
    const dataset::Keypoint2d& joint = known ? expected[j] : likely->keypoints[j];
    maps->prior_x_px.push_back(static_cast<float>(joint.x_px));
    maps->prior_y_px.push_back(static_cast<float>(joint.y_px));
  }
  maps->prior_scale_px = scale;
  maps->prior_power = 2;
}

JointMaps Posenet::Run(const Image& crop, const std::vector<dataset::Keypoint2d>& expected) const {
  const internal::PosenetOutputs outputs = graph_.Run(crop);
  JointMaps maps;
  maps.joints = 17;
  maps.height = static_cast<int>(outputs.heat.shape[1]);
  maps.width = static_cast<int>(outputs.heat.shape[2]);
  maps.stride_px = internal::kPosenetStride;
  const size_t cells = static_cast<size_t>(maps.height) * maps.width;
  maps.score.resize(17 * cells), maps.dx_px.resize(17 * cells), maps.dy_px.resize(17 * cells);
  for (size_t cell = 0; cell < cells; ++cell) {
    for (size_t j = 0; j < 17; ++j) {
      maps.score[j * cells + cell] = outputs.heat.values[cell * 17 + j];
      maps.dy_px[j * cells + cell] = outputs.offset.values[cell * 34 + j];
      maps.dx_px[j * cells + cell] = outputs.offset.values[cell * 34 + 17 + j];
    }
  }
  AddPrior(outputs, input_px_, expected, &maps);
  return maps;
}

}  // namespace

std::unique_ptr<JointNet> OpenPosenet(const std::string& models_folder, int input_px) {
  return std::make_unique<Posenet>(models_folder, input_px);
}

}  // namespace mvstudio::detect
