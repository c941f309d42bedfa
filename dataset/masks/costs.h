// Private: OpenCV's types, for the .cc files of the masks.
#pragma once

#include <opencv2/core.hpp>

#include "dataset/masks/cut.h"
#include "dataset/masks/masks.h"
#include "dataset/masks/patch.h"

/// What it costs to call a pixel a person's or the background's.
namespace mvstudio::dataset::internal {

/// Colour evidence for a person at a pixel of the frame, nats, clamped to +-8.
double PersonEvidence(const Image& rgb, int x, int y, const CameraMaskModel& model);

struct PixelCosts {
  double person = 0, background = 0;
};
/// Costs by colour alone, nats.
PixelCosts ColourCosts(const Patch& patch, int x, int y, const CameraMaskModel& model, const MaskOptions& options);

/// Fills the contrast between neighbours of which one is free, and its scale.
void FillContrast(const Patch& patch, CutProblem* problem);

/// Fills the costs of the free pixels. Without a body every pixel may be a person's. Pixels beyond reach become
/// background.
void FillCosts(const Patch& patch, const ProjectedBody* body, const CameraMaskModel& model, const MaskOptions& options,
               CutProblem* problem);

cv::Mat LabelMat(const CutProblem& problem);

}  // namespace mvstudio::dataset::internal
