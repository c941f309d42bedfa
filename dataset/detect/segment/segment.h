#pragma once

#include <memory>
#include <string>

#include "core/image.h"

/// Nets that segment people. They work on a small square (256 px): sufficient to locate a person, too coarse for the
/// outline, which dataset/masks/masks.h determines.
namespace mvstudio::detect {

/// Half-open pixel ranges.
struct ImageBox {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  bool empty() const { return x1 <= x0 || y1 <= y0; }
};

/// Smallest box of the pixels of at least `least`, with a margin as a fraction of its longer side, inside the image; empty
/// when there is no such pixel.
ImageBox BoxAround(const Image& grey, int least, double margin);

/// Probability of a person per pixel. Thread-safe.
class Segmenter {
 public:
  virtual ~Segmenter() = default;
  /// (H, W, 1), 0..255, of the size of `rgb` (RGB). The net sees a square around `box`. With an empty box it sees the
  /// whole image, and then again the region it found. Nothing outside the square is a person.
  virtual Image Probability(const Image& rgb, const ImageBox& box) const = 0;
};

/// The net "selfie" of dataset/detect/models/models.h: 256 x 256. Throws MissingToolError when it is not installed.
std::unique_ptr<Segmenter> SelfieSegmenter(const std::string& models_folder = "");

struct OnnxSegmenterOptions {
  int width = 256, height = 256;
  double scale = 1.0 / 255;
  double mean_r = 0, mean_g = 0, mean_b = 0;
  int person_channel = -1;
};

template <class Visitor>
void VisitFields(Visitor&& visit, OnnxSegmenterOptions& o) {
  visit("onnx-width", o.width, "px; width of the net's input");
  visit("onnx-height", o.height, "px; height of the net's input");
  visit("onnx-scale", o.scale, "input = scale (level - mean), channels R, G, B");
  visit("onnx-mean-r", o.mean_r, "grey levels");
  visit("onnx-mean-g", o.mean_g, "grey levels");
  visit("onnx-mean-b", o.mean_b, "grey levels");
  visit("onnx-channel", o.person_channel,
        "channel of the class 'person' of a net with several (15 in Pascal VOC); -1: the only one, else the last of two");
}

/// A net in ONNX form through OpenCV: input (1, 3, H, W), output (1, K, H', W') or (1, H', W'). One channel: a
/// probability, or its logit when values leave 0..1. Several: probabilities that add up to one, or logits. Throws IoError,
/// FormatError (unreadable for OpenCV, outputs of another form), UsageError for invalid sizes and channels.
std::unique_ptr<Segmenter> OnnxSegmenter(const std::string& path, const OnnxSegmenterOptions& options = {});

}  // namespace mvstudio::detect
