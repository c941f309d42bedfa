// Private: OpenCV's types, for the .cc files of the masks.
#pragma once

#include <opencv2/core.hpp>

#include "dataset/masks/masks.h"
#include "dataset/masks/patch.h"

namespace mvstudio::dataset::internal {

/// Decides the pixels along the outline of `mask` (CV_8U, full resolution) by the fraction of each that the person covers.
/// The pixel's colour is a mixture of the background behind it and of the person's colours beside it, in linear light.
/// `coverage` receives the fraction, CV_8U.
void DecideByCoverage(const Patch& patch, const cv::Mat& bones, const MaskOptions& options, cv::Mat* mask, cv::Mat* coverage);

/// `coverage` clamped to the side of one half that `mask` states.
cv::Mat OnTheRightSide(const cv::Mat& coverage, const cv::Mat& mask);

}  // namespace mvstudio::dataset::internal
