#include <cmath>
#include <filesystem>
#include <mutex>
#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "dataset/detect/segment/crop_segmenter.h"

namespace mvstudio::detect {
namespace {

constexpr int kMostSide = 4096;

/// In place: values outside 0..1 are logits.
void ToProbability(cv::Mat* values) {
  double low = 0, high = 0;
  cv::minMaxLoc(*values, &low, &high);
  if (low >= 0 && high <= 1) return;
  cv::exp(-*values, *values);
  *values = 1 / (1 + *values);
}

/// Share of one channel in the softmax, or the channel itself where the channels add up to one already.
cv::Mat ChannelProbability(const std::vector<cv::Mat>& channels, int person) {
  cv::Mat sum = cv::Mat::zeros(channels[0].size(), CV_32F), most = channels[0].clone();
  double low = 0, high = 0;
  bool in_range = true;
  for (const cv::Mat& c : channels) {
    sum += c;
    most = cv::max(most, c);
    cv::minMaxLoc(c, &low, &high);
    in_range = in_range && low >= -1e-3 && high <= 1.001;
  }
  cv::minMaxLoc(sum, &low, &high);
  if (in_range && low > 0.99 && high < 1.01) return channels[person].clone();
  cv::Mat total = cv::Mat::zeros(sum.size(), CV_32F), term, wanted;
  for (size_t k = 0; k < channels.size(); ++k) {
    cv::exp(channels[k] - most, term);
    total += term;
    if (int(k) == person) wanted = term.clone();
  }
  return wanted / total;
}

class Onnx : public internal::CropSegmenter {
 public:
  Onnx(const std::string& path, const OnnxSegmenterOptions& options) : path_(path), options_(options) {
    if (!std::filesystem::is_regular_file(path)) throw IoError(path, "there is no such file");
    try {
      net_ = cv::dnn::readNetFromONNX(path);
    } catch (const cv::Exception& error) {
      throw FormatError(path, "", "OpenCV cannot read this net: " + error.err);
    }
    if (net_.empty()) throw FormatError(path, "", "holds no net");
    if (options.width < 1 || options.height < 1 || options.width > kMostSide || options.height > kMostSide)
      throw UsageError("option 'onnx-width' and option 'onnx-height' must be in 1.." + std::to_string(kMostSide));
  }

 protected:
  cv::Size InputSize() const override { return {options_.width, options_.height}; }

  cv::Mat Run(const cv::Mat& crop) const override {
    const cv::Scalar mean(options_.mean_r, options_.mean_g, options_.mean_b);
    const cv::Mat blob = cv::dnn::blobFromImage(crop, options_.scale, cv::Size(), mean, false, false, CV_32F);
    cv::Mat out;
    try {
      const std::lock_guard<std::mutex> lock(mutex_);
      net_.setInput(blob);
      out = net_.forward().clone();
    } catch (const cv::Exception& error) {
      throw FormatError(path_, "",
                        "does not run on " + std::to_string(options_.width) + "x" + std::to_string(options_.height) +
                            " px (option 'onnx-width', option 'onnx-height'): " + error.err);
    }
    return PersonChannel(out);
  }

 private:
  cv::Mat PersonChannel(const cv::Mat& out) const {
    const bool with_channels = out.dims == 4 && out.size[0] == 1;
    if (out.type() != CV_32F || (!with_channels && !(out.dims == 3 && out.size[0] == 1)))
      throw FormatError(path_, "output", "is neither (1, K, H, W) nor (1, H, W) of floats");
    const int count = with_channels ? out.size[1] : 1, h = out.size[out.dims - 2], w = out.size[out.dims - 1];
    std::vector<cv::Mat> channels;
    for (int k = 0; k < count; ++k)
      channels.emplace_back(h, w, CV_32F, const_cast<float*>(out.ptr<float>()) + size_t(k) * h * w);
    if (count == 1) {
      cv::Mat values = channels[0].clone();
      ToProbability(&values);
      return values;
    }
    const int person = options_.person_channel >= 0 ? options_.person_channel : (count == 2 ? 1 : -1);
    if (person < 0 || person >= count)
      throw UsageError("option 'onnx-channel': which of the " + std::to_string(count) + " channels of " + path_ +
                       " is the person's?");
    return ChannelProbability(channels, person);
  }

  std::string path_;
  OnnxSegmenterOptions options_;
  mutable cv::dnn::Net net_;
  mutable std::mutex mutex_;
};

}  // namespace

std::unique_ptr<Segmenter> OnnxSegmenter(const std::string& path, const OnnxSegmenterOptions& options) {
  return std::make_unique<Onnx>(path, options);
}

}  // namespace mvstudio::detect
