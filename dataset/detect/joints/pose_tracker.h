#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "dataset/detect/joints/joint_net.h"

/// Keypoints of people in the video of one camera.
namespace mvstudio::detect {

/// How many crops are looked at for a person.
enum class PoseQuality { kFast, kBalanced, kExact };
std::string_view ToString(PoseQuality quality);
/// Throws UsageError.
void FromString(const std::string& text, PoseQuality* quality);

struct PoseOptions {
  PoseQuality quality = PoseQuality::kBalanced;
  int max_persons = 1;
  int redetect_frames = 30;
  double min_person_score = 0.15;
  double min_joint_score = 0.02;
};

template <class Visitor>
void VisitFields(Visitor&& visit, PoseOptions& o) {
  visit("quality", o.quality,
        "fast: one crop per person. balanced: and its mirror image. exact: crops of three sizes, each with its mirror image");
  visit("max-persons", o.max_persons, "people tracked per camera; time grows in proportion");
  visit(
      "redetect-frames", o.redetect_frames,
      "frames between searches of whole images, which also follow whenever a person is missing; a larger person takes a place");
  visit("min-person-score", o.min_person_score, "0..1; a person whose joints score less on average counts as lost");
  visit("min-joint-score", o.min_joint_score, "0..1; joints that score less are written as not detected");
}

/// The settings of a `quality`.
struct CropPlan {
  std::vector<double> scales;  ///< of the crop; 1: the person fills the net's person_fill()
  bool mirror = false;
  int passes = 1;        ///< successive crops for a newly found person, each around the joints of the previous one
  int posenet_px = 257;  ///< crop of PoseNet
};
CropPlan PlanOf(PoseQuality quality);

struct TrackedPerson {
  int id = 0;  ///< the same through the whole video
  dataset::Person2d pose;
  double score = 0;        ///< mean of the joints'
  Crop crop;               ///< in which the joints were found
  double usual_score = 0;  ///< in the previous frames
};

/// Joints of a person in `crop`, in pixels of the full image; those outside the image have score 0. `expected`: likely
/// positions; without joints: unknown.
dataset::Person2d LocateJoints(const JointNet& net, const Image& rgb, const Crop& crop, const CropPlan& plan,
                               const dataset::Person2d& expected = {});

/// Tracks people from frame to frame, with a crop around the last pose; a lost person is searched in the whole image. Use
/// one tracker per camera.
class PoseTracker {
 public:
  /// `net` and `finder` must outlive the tracker. Without a finder, the whole image is the crop of the only person.
  PoseTracker(const JointNet& net, const PersonFinder* finder, const PoseOptions& options, const CropPlan& plan);
  /// People in the next frame, by id.
  std::vector<TrackedPerson> Next(const Image& rgb);

 private:
  void Follow(const Image& rgb);
  void Search(const Image& rgb);
  TrackedPerson Examine(const Image& rgb, const dataset::Person2d& rough, int passes) const;
  TrackedPerson LookAgain(const Image& rgb, const TrackedPerson& before, const TrackedPerson& now) const;
  TrackedPerson Locate(const Image& rgb, const Crop& crop, const dataset::Person2d& expected) const;

  const JointNet& net_;
  const PersonFinder* finder_;
  PoseOptions options_;
  CropPlan plan_;
  std::vector<TrackedPerson> people_;
  std::vector<TrackedPerson> lost_;  // as last seen, to give their ids back
  int next_id_ = 0;
  int frames_ = 0;
};

}  // namespace mvstudio::detect
