// Private: OpenCV's types, for the segmentation nets.
#pragma once

#include <opencv2/core.hpp>

#include "dataset/detect/segment/segment.h"

namespace mvstudio::detect::internal {

/// A segmenter that runs on a crop: input and output of the net are handled in the same way for all nets.
class CropSegmenter : public Segmenter {
 public:
  Image Probability(const Image& rgb, const ImageBox& box) const override;

 protected:
  virtual cv::Size InputSize() const = 0;
  /// `crop`: CV_8UC3 RGB of InputSize(). Returns the probability, CV_32F in 0..1, of any size.
  virtual cv::Mat Run(const cv::Mat& crop) const = 0;

 private:
  Image Once(const Image& rgb, const ImageBox& box) const;
};

}  // namespace mvstudio::detect::internal
