// Private: OpenCV's types, for the .cc files of the masks.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "core/image.h"
#include "dataset/masks/limbs.h"
#include "dataset/masks/masks.h"

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

}  // namespace mvstudio::dataset::internal
