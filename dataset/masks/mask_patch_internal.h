#pragma once

#include <opencv2/core.hpp>

#include "dataset/masks/mask_internal.h"

/// Part of a frame with the data that the cut needs. OpenCV's types: only for the .cc files of the masks.
namespace mvstudio::dataset::internal {

cv::Mat View(const Image& image);
/// 255 within `radius_px` of a nonzero pixel; its time does not depend on the radius.
Image Dilated(const Image& mask, int radius_px);

/// Part of the frame and of the background model at one resolution; its pixel (x, y) is pixel offset + scale (x, y) of the
/// frame.
struct Patch {
  double scale = 1;
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();
  cv::Mat rgb;         // CV_32FC3
  cv::Mat background;  // CV_32FC3, exposure of this frame
  cv::Mat sigma;       // CV_32F
  cv::Mat known;       // CV_32F, 1 where known
  cv::Mat hint;        // CV_32F, nats for a person from a net, other cameras and the frame before; empty when there is none
  int width() const { return rgb.cols; }
  int height() const { return rgb.rows; }
  Eigen::Vector2d FramePixel(int x, int y) const { return offset + scale * Eigen::Vector2d(x, y); }
};

/// Brightness of this frame over that of the background model, by channel, from known pixels outside `people`.
cv::Scalar ExposureGain(const Image& rgb, const PixelBox& people, const BackgroundModel& model);

/// Full resolution.
Patch MakePatch(const Image& rgb, const PixelBox& box, const BackgroundModel& model, const cv::Scalar& gain);
/// Returns the patch unchanged when it is only slightly larger than requested.
Patch Reduced(const Patch& full, int longer_side_px);

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

/// Decides the pixels along the outline of `mask` (CV_8U, full resolution) by the fraction of each that the person covers.
/// The pixel's colour is a mixture of the background behind it and of the person's colours beside it, in linear light.
/// `coverage` receives the fraction, CV_8U.
void DecideByCoverage(const Patch& patch, const cv::Mat& bones, const MaskOptions& options, cv::Mat* mask, cv::Mat* coverage);

/// `coverage` clamped to the side of one half that `mask` states.
cv::Mat OnTheRightSide(const cv::Mat& coverage, const cv::Mat& mask);

}  // namespace mvstudio::dataset::internal
