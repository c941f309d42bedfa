#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "avatar/body/body_template.h"
#include "avatar/nets/model.h"
#include "avatar/run/pretrain/pretrain_samples.h"

/// How well a network predicts the labels of samples.
namespace mvstudio::avatar {

/// Points of a template's surface by part and chart coordinates, to the nearest texel of a 64 x 64 chart.
class SurfaceMap {
 public:
  explicit SurfaceMap(const body::BodyTemplate& body);
  /// Rest position in body, metres; `part` 1..24, u and v in [0, 1]. Places of a chart that no face has: the nearest that one
  /// has.
  Eigen::Vector3f At(int part, double u, double v) const;

 private:
  std::vector<Eigen::Vector3f> x_in_body_;  // (24, S, S)
};

struct LabelScore {
  int64_t samples = 0;
  double part_accuracy = 0;  ///< share of the person's pixels with the right part
  double mask_iou = 0;       ///< mean over the images
  double uv_error = 0;       ///< mean |difference| of u and v in [0, 1], where the part is right
  double surface_mm = 0;     ///< median distance at rest between predicted and true point, where both are on the person
};

/// Of predicted parts (N, H, W) uint8, 0 background, and their coordinates (N, 2, H, W) float32 in [0, 1]. `surfaces`: of each
/// template. NaN where there is nothing to compare.
LabelScore CompareLabels(const at::Tensor& part, const at::Tensor& uv, const PretrainSamples& samples,
                         const std::vector<SurfaceMap>& surfaces);

/// The same of what the network predicts.
LabelScore ScoreLabels(AvatarModel& model, const PretrainSamples& samples, const std::vector<SurfaceMap>& surfaces);

}  // namespace mvstudio::avatar
