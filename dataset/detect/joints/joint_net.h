#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/fields.h"
#include "core/image.h"
#include "dataset/detect/joints/joint_maps.h"
#include "dataset/detect/tfjs/tfjs_graph.h"
#include "geometry/skeleton/skeleton.h"

/// Nets that find the joints of one person in a square crop, and of several in a whole image.
namespace mvstudio::detect {

/// A net for crops. Implementations are immutable and may run in several threads.
class JointNet {
 public:
  virtual ~JointNet() = default;
  virtual const geometry::Skeleton& skeleton() const = 0;
  virtual int input_px() const = 0;        ///< side of its crop
  virtual double person_fill() const = 0;  ///< fraction of the crop's side that a person's joints should fill
  /// `expected`: likely positions of the person's joints, in crop pixels; empty: unknown. Distinguishes people in one
  /// crop.
  virtual JointMaps Run(const Image& crop, const std::vector<dataset::Keypoint2d>& expected = {}) const = 0;
};

/// PoseNet (Papandreou et al. 2018, "PersonLab") with a crop of 16 n + 1 pixels. Throws like ReadModel.
std::unique_ptr<JointNet> OpenPosenet(const std::string& models_folder, int input_px);

/// MoveNet Thunder, 256 px.
std::unique_ptr<JointNet> OpenMovenet(const std::string& models_folder);

/// BlazePose GHUM full (Bazarevsky et al. 2020, arXiv:2006.10204), 256 px: 33 joints with heels, toes and fingers. Throws like
/// ReadModel.
std::unique_ptr<JointNet> OpenBlazepose(const std::string& models_folder);

/// Values of a net's input.
enum class InputScale {
  kImagenet,   ///< ImageNet's mean 0, standard deviation 1
  kUnit,       ///< 0..1
  kSymmetric,  ///< -1..1
  kNone,       ///< 0..255
};
std::string_view ToString(InputScale scale);  ///< "imagenet", "unit", "symmetric", "none"
/// Throws UsageError.
void FromString(const std::string& text, InputScale* scale);

/// Input format and joints of an ONNX net.
struct OnnxOptions {
  std::string skeleton = "coco17";
  int width_px = 0, height_px = 0;  ///< 0: from the file; if it does not state them, 192 x 256
  InputScale normalization = InputScale::kImagenet;
  bool bgr = false;
};

template <class Visitor>
void VisitFields(Visitor&& visit, OnnxOptions& o) {
  visit("onnx-skeleton", o.skeleton, "onnx: the joints of the net's heat maps, in order");
  visit("onnx-width", o.width_px, "onnx: px; width of the net's input");
  visit("onnx-height", o.height_px, "onnx: px; height of the net's input");
  visit("onnx-normalization", o.normalization,
        "onnx: values of the input: imagenet, unit (0..1), symmetric (-1..1) or none (0..255)");
  visit("onnx-bgr", o.bgr, "onnx: the net takes blue first");
}

/// A top-down net of OpenCV dnn with one input (1, 3, height, width) and heat maps (1, joints, h, w). Throws IoError,
/// FormatError (not ONNX, unknown layers, other outputs), UsageError (options).
std::unique_ptr<JointNet> OpenOnnx(const std::string& path, const OnnxOptions& options);

/// A person in an image, before a crop is made.
struct CoarsePerson {
  dataset::Person2d pose;  ///< coco17, pixels of the image
  double score = 0;        ///< mean of the joints'
};

/// Finds people in whole images: PoseNet on the image and on overlapping tiles of it, decoded as in PersonLab. Decoding is
/// greedy from the best joint along the displacements, without candidates on a person found before.
class PersonFinder {
 public:
  explicit PersonFinder(const std::string& models_folder);
  ~PersonFinder();
  /// Sorted by size times score (capped at a score that is certain); the largest person is assumed to be the subject.
  /// `levels`: 1 the image alone, 2 also tiles of 0.7 of its longer side, 3 also of 0.49.
  std::vector<CoarsePerson> Find(const Image& rgb, int max_persons, int levels) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Object keypoint similarity (COCO) of two poses of one skeleton, over joints that both have; 0 when there are none.
double PoseSimilarity(const dataset::Person2d& a, const dataset::Person2d& b, double min_score);

}  // namespace mvstudio::detect
