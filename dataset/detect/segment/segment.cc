#include "dataset/detect/segment/segment.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <opencv2/imgproc.hpp>

#include "core/check.h"
#include "core/error.h"
#include "dataset/detect/models/models.h"
#include "dataset/detect/segment/crop_segmenter.h"

namespace mvstudio::detect {
namespace {

constexpr int kSelfieSide = 256;

class Selfie : public internal::CropSegmenter {
 public:
  explicit Selfie(const std::string& folder) : graph_(ReadModel("selfie", folder)) {}

 protected:
  cv::Size InputSize() const override { return {kSelfieSide, kSelfieSide}; }

  cv::Mat Run(const cv::Mat& crop) const override {
    cv::Mat input;
    crop.convertTo(input, CV_32FC3, 1.0 / 255);
    const auto* first = input.ptr<float>();
    FloatTensor tensor{{1, kSelfieSide, kSelfieSide, 3}, std::vector<float>(first, first + input.total() * 3)};
    const std::lock_guard<std::mutex> lock(mutex_);  // the graph has threads of its own
    const std::vector<FloatTensor> out = graph_.Run({tensor});
    const std::vector<int64_t>& shape = out.at(0).shape;
    if (shape.size() != 4 || shape[3] != 1) throw FormatError("selfie", "output", "has another shape than (1, H, W, 1)");
    return cv::Mat(int(shape[1]), int(shape[2]), CV_32F, const_cast<float*>(out[0].values.data())).clone();
  }

 private:
  TfjsGraph graph_;
  mutable std::mutex mutex_;
};

/// The box as a square about its middle, which may leave the image.
cv::Rect Square(const ImageBox& box, const cv::Size& input) {
  const double w = box.x1 - box.x0, h = box.y1 - box.y0, scale = std::max(w / input.width, h / input.height);
  const int side_x = std::max(1, int(std::ceil(scale * input.width))),
            side_y = std::max(1, int(std::ceil(scale * input.height)));
  return {int(std::floor(0.5 * (box.x0 + box.x1 - side_x))), int(std::floor(0.5 * (box.y0 + box.y1 - side_y))), side_x, side_y};
}

}  // namespace

ImageBox BoxAround(const Image& grey, int least, double margin) {
  MVS_CHECK(grey.channels == 1, "a grey image is needed");
  ImageBox box{grey.width, grey.height, 0, 0};
  for (int y = 0; y < grey.height; ++y) {
    for (int x = 0; x < grey.width; ++x) {
      if (*grey.Pixel(x, y) < least) continue;
      box.x0 = std::min(box.x0, x), box.x1 = std::max(box.x1, x + 1);
      box.y0 = std::min(box.y0, y), box.y1 = std::max(box.y1, y + 1);
    }
  }
  if (box.empty()) return {};
  const int pad = int(std::ceil(margin * std::max(box.x1 - box.x0, box.y1 - box.y0)));
  return {std::max(0, box.x0 - pad), std::max(0, box.y0 - pad), std::min(grey.width, box.x1 + pad),
          std::min(grey.height, box.y1 + pad)};
}

Image internal::CropSegmenter::Once(const Image& rgb, const ImageBox& box) const {
  const cv::Mat image(rgb.height, rgb.width, CV_8UC3, const_cast<uint8_t*>(rgb.pixels.data()));
  const cv::Rect square = Square(box, InputSize()), inside = square & cv::Rect(0, 0, rgb.width, rgb.height);
  Image out(rgb.width, rgb.height, 1, 0);
  if (inside.empty()) return out;
  cv::Mat crop;
  cv::copyMakeBorder(image(inside), crop, inside.y - square.y, square.br().y - inside.br().y, inside.x - square.x,
                     square.br().x - inside.br().x, cv::BORDER_REPLICATE);
  cv::resize(crop, crop, InputSize(), 0, 0, crop.cols > InputSize().width ? cv::INTER_AREA : cv::INTER_LINEAR);
  cv::Mat probability = Run(crop);
  cv::patchNaNs(probability, 0);
  cv::resize(probability, probability, square.size(), 0, 0, cv::INTER_LINEAR);
  cv::Mat target(out.height, out.width, CV_8U, out.pixels.data());
  probability(inside - square.tl()).convertTo(target(inside), CV_8U, 255);
  return out;
}

Image internal::CropSegmenter::Probability(const Image& rgb, const ImageBox& box) const {
  MVS_CHECK(rgb.channels == 3 && !rgb.empty(), "an RGB image is needed");
  if (!box.empty()) return Once(rgb, box);
  const Image first = Once(rgb, {0, 0, rgb.width, rgb.height});
  const ImageBox found = BoxAround(first, 128, 0.15);
  const bool whole = found.empty() || (found.x1 - found.x0 > 0.8 * rgb.width && found.y1 - found.y0 > 0.8 * rgb.height);
  return whole ? first : Once(rgb, found);
}

std::unique_ptr<Segmenter> SelfieSegmenter(const std::string& models_folder) { return std::make_unique<Selfie>(models_folder); }

}  // namespace mvstudio::detect
