#include <array>
#include <cmath>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/detect/joints/joint_net.h"

namespace mvstudio::detect {
namespace {

struct Scaling {
  std::array<float, 3> mean = {0, 0, 0}, deviation = {1, 1, 1};  // of R, G, B in 0..255
};

constexpr ChoiceWords<InputScale, 4> kInputScales = {{{InputScale::kImagenet, "imagenet"},
                                                      {InputScale::kUnit, "unit"},
                                                      {InputScale::kSymmetric, "symmetric"},
                                                      {InputScale::kNone, "none"}}};

Scaling ScalingOf(InputScale scale) {
  if (scale == InputScale::kImagenet) return {{123.675f, 116.28f, 103.53f}, {58.395f, 57.12f, 57.375f}};
  if (scale == InputScale::kUnit) return {{0, 0, 0}, {255, 255, 255}};
  if (scale == InputScale::kSymmetric) return {{127.5f, 127.5f, 127.5f}, {127.5f, 127.5f, 127.5f}};
  return {};
}

class OnnxNet : public JointNet {
 public:
  OnnxNet(const std::string& path, const OnnxOptions& options);
  const geometry::Skeleton& skeleton() const override { return skeleton_; }
  int input_px() const override { return std::max(width_, height_); }
  double person_fill() const override { return 0.8; }
  JointMaps Run(const Image& crop, const std::vector<dataset::Keypoint2d>& expected) const override;

 private:
  cv::Mat Forward(const cv::Mat& blob) const;
  JointMaps ToMaps(const cv::Mat& heat) const;

  std::string path_;
  const geometry::Skeleton skeleton_;
  Scaling scaling_;
  bool bgr_ = false;
  int width_ = 0, height_ = 0;
  mutable std::mutex mutex_;  // a cv::dnn::Net is not to be run by two threads at once
  mutable cv::dnn::Net net_;
};

OnnxNet::OnnxNet(const std::string& path, const OnnxOptions& options)
    : path_(path),
      skeleton_(geometry::SkeletonFrom(options.skeleton)),
      scaling_(ScalingOf(options.normalization)),
      bgr_(options.bgr) {
  constexpr int kMaxPx = 4096;
  width_ = options.width_px, height_ = options.height_px;
  const std::string bytes = ReadFile(path);
  try {
    net_ = cv::dnn::readNetFromONNX(bytes.data(), bytes.size());
    if (net_.empty()) throw FormatError(path, "", "holds no network");
    net_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
  } catch (const cv::Exception& error) {
    throw FormatError(path, "", "is no ONNX net that OpenCV reads: " + error.err);
  }
  if (width_ < 1 || height_ < 1 || width_ > kMaxPx || height_ > kMaxPx)
    throw UsageError("option 'onnx-width' and option 'onnx-height' must be 1 to 4096");
  Run(Image(input_px(), input_px(), 3, 127), {});  // a net of another form is refused here, not at the first person
}

cv::Mat OnnxNet::Forward(const cv::Mat& blob) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    net_.setInput(blob);
    return net_.forward().clone();
  } catch (const cv::Exception& error) {
    throw FormatError(
        path_, "",
        "does not run on an input of " + std::to_string(width_) + " x " + std::to_string(height_) + ": " + error.err);
  }
}

JointMaps OnnxNet::ToMaps(const cv::Mat& heat) const {
  const int joints = static_cast<int>(skeleton_.joints.size());
  if (heat.dims != 4 || heat.size[0] != 1 || heat.type() != CV_32F || heat.size[2] < 3 || heat.size[3] < 3) {
    throw FormatError(path_, "output", "must be heat maps (1, joints, height, width)");
  }
  if (heat.size[1] != joints) {
    throw FormatError(path_, "output",
                      "has " + std::to_string(heat.size[1]) + " heat maps, skeleton " + skeleton_.name + " has " +
                          std::to_string(joints) + " joints");
  }
  const double stride = static_cast<double>(height_) / heat.size[2];
  if (std::abs(stride * heat.size[3] - width_) > 0.5)
    throw FormatError(path_, "output", "its heat maps have another shape than its input");
  JointMaps maps;
  maps.joints = joints, maps.height = heat.size[2], maps.width = heat.size[3];
  maps.stride_px = stride;
  maps.origin_x_px = (input_px() - width_) / 2 + 0.5 * stride - 0.5;
  maps.origin_y_px = (input_px() - height_) / 2 + 0.5 * stride - 0.5;
  maps.score.assign(heat.ptr<float>(), heat.ptr<float>() + heat.total());
  for (float& score : maps.score) {
    if (!std::isfinite(score)) throw FormatError(path_, "output", "is not finite");
    score = std::clamp(score, 0.0f, 1.0f);
  }
  return maps;
}

/// The net's input is the middle of the square crop, its longer side the crop's. Cells outside it stay empty.
JointMaps OnnxNet::Run(const Image& crop, const std::vector<dataset::Keypoint2d>& /*expected*/) const {
  const int x0 = (crop.width - width_) / 2, y0 = (crop.height - height_) / 2;
  const int sizes[4] = {1, 3, height_, width_};
  cv::Mat blob(4, sizes, CV_32F);
  for (int c = 0; c < 3; ++c) {
    const int channel = bgr_ ? 2 - c : c;
    float* plane = blob.ptr<float>(0, c);
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        const float level = crop.Pixel(x0 + x, y0 + y)[channel];
        plane[static_cast<size_t>(y) * width_ + x] = (level - scaling_.mean[channel]) / scaling_.deviation[channel];
      }
    }
  }
  return ToMaps(Forward(blob));
}

}  // namespace

std::string_view ToString(InputScale scale) { return WordOf(kInputScales, scale); }

void FromString(const std::string& text, InputScale* scale) {
  *scale =
      KnownChoice(kInputScales, text, "option 'onnx-normalization' " + text + ": must be imagenet, unit, symmetric or none");
}

std::unique_ptr<JointNet> OpenOnnx(const std::string& path, const OnnxOptions& options) {
  return std::make_unique<OnnxNet>(path, options);
}

}  // namespace mvstudio::detect
