#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "avatar/body/fit/fit_body.h"
#include "avatar/body/fit/photometric.h"

/// Poses of a body whose surface is known, by joints, outlines and brightness.
namespace mvstudio::body {

/// A body and how its poses are found.
class StepPoser {
 public:
  /// `brightness`: null for outlines alone; it, `body` and `step`s must outlive this.
  StepPoser(const BodyTemplate& body, double joint_sigma_m, const MeanBrightness* brightness);

  /// Where the body's outline should move in the views that are `used` (views), as residuals of the pose.
  std::vector<SurfaceResidual> MeasureOutlines(const FitStep& step, const std::vector<uint8_t>& used,
                                               const ArticulatedPose& pose, double max_px) const;
  /// A view each.
  std::vector<std::vector<SeenVertex>> MeasureBrightness(const FitStep& step, const std::vector<uint8_t>& used,
                                                         const ArticulatedPose& pose, double sigma_px) const;

  /// Joints, `prior` and outlines within `max_px`: a few steps from `pose`.
  ArticulatedPose ByOutlines(const FitStep& step, const std::vector<uint8_t>& used, const RotationPrior& prior, double max_px,
                             const ArticulatedPose& pose) const;
  /// Same with brightness, Gaussian of `sigma_px`.
  ArticulatedPose ByBrightness(const FitStep& step, const std::vector<uint8_t>& used, const RotationPrior& prior,
                               double sigma_px, double max_px, const ArticulatedPose& pose) const;

 private:
  PoseProblemInput Outlines(const FitStep& step, const std::vector<uint8_t>& used, const RotationPrior& prior, double max_px,
                            const ArticulatedPose& pose) const;
  void AddBrightness(const FitStep& step, const std::vector<uint8_t>& used, double sigma_px, const ArticulatedPose& pose,
                     std::vector<SurfaceResidual>* residuals) const;

  const BodyTemplate* body_;
  const MeanBrightness* brightness_;
  double joint_sigma_m_;
};

/// Poses of time steps that a fitted body has not seen, by frame.
struct StepPoses {
  std::map<int, ArticulatedPose> poses;  ///< time steps whose trunk the joints determine
  std::vector<RejectedView> rejected;    ///< silhouettes far from what joints and the others say
  std::vector<double> iou_before, iou;   ///< mean over the silhouettes of each time step: by joints alone, by images too
};

/// Poses by joints, learned priors, silhouettes and, with `brightness`, the surface's brightness. A pose that covers the
/// silhouettes less well than the one by joints alone is not taken.
StepPoses PoseByImages(const PersonBody& person, const MeanBrightness* brightness, const std::vector<FitStep>& steps,
                       const RunContext& run);

}  // namespace mvstudio::body
