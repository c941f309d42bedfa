#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

#include "avatar/body/fit/fit_body.h"

/// What silhouettes say of a surface that moves with the pose.
namespace mvstudio::body {

/// Offsets at rest (3, V), metres in body, for a pose.
using PoseOffsets = std::function<Eigen::Matrix3Xf(const ArticulatedPose&)>;

/// A time step that a body was posed in.
struct PosedStep {
  const FitStep* step = nullptr;
  ArticulatedPose seen;       ///< by joints and images
  ArticulatedPose by_joints;  ///< by joints alone: what judges, as it has not adapted to the silhouettes
  std::vector<uint8_t> used;  ///< (views) not rejected
};

/// A body that skins alone explains, and the time steps that may show more.
struct TakeOutlines {
  BodyTemplate body;  ///< without its shapes
  double joint_sigma_m = 0;
  std::vector<PosedStep> steps;
};

/// The steps with a pose and a view, in order. They and `person` must outlive this.
TakeOutlines TakeOutlinesOf(const PersonBody& person, const std::vector<FitStep>& steps,
                            const std::vector<RejectedView>& rejected, const RunContext& run);

/// One minus the mean IoU of each of the steps in `indices`, posed by joints alone; without `offsets` that of the body as it
/// is.
std::vector<double> StepLosses(const TakeOutlines& take, const std::vector<int>& indices,
                               const std::optional<PoseOffsets>& offsets, const RunContext& run);

/// The body with offsets (3, V) at rest.
BodyTemplate WithOffsets(const BodyTemplate& body, const Eigen::Matrix3Xf& offsets);

}  // namespace mvstudio::body
