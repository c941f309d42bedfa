#pragma once

#include <vector>

#include "avatar/body/fit/fit_state.h"

namespace mvstudio::body {

/// Loss of a person's body in each held-out time step, posed by joints alone: one minus the mean IoU of its silhouettes. NaN
/// for other time steps.
std::vector<double> OutlineLoss(const PersonBody& person, const std::vector<FitStep>& steps, const RunContext& run);

/// Same for brightness: mean absolute deviation of the surface from its mean over the fitted time steps, in parts of white.
std::vector<double> BrightnessLoss(const PersonBody& person, const std::vector<FitStep>& steps, double sigma_px,
                                   const RunContext& run);

/// IoU of every silhouette (views) of one time step.
std::vector<double> StepIous(const BodyTemplate& body, const ArticulatedPose& pose, const FitStep& step);

/// IoU of every silhouette (steps, views) with the body in a fit's present poses; NaN where there is no pose.
std::vector<std::vector<double>> ViewIous(const FitState& state, const std::vector<FitStep>& steps, const RunContext& run);

/// Takes silhouettes out of `used` (steps, views) of which four times as much as in the median one, and at least 15 %, does not
/// overlap with the body. Returns the new ones.
std::vector<RejectedView> RejectViews(const std::vector<FitStep>& steps, const std::vector<std::vector<double>>& ious,
                                      std::vector<std::vector<uint8_t>>* used);

/// How far each camera's silhouettes are shifted against the body: least squares over the outline's gaps along its normals, the
/// standard error over the time steps.
std::vector<CameraFit> CompareCameras(const PersonBody& person, const FitState& state, const std::vector<FitStep>& steps,
                                      const std::vector<std::vector<double>>& before, const RunContext& run);

}  // namespace mvstudio::body
