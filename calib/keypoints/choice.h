#pragma once

#include <string>
#include <vector>

#include "calib/keypoints/bundle.h"
#include "core/progress.h"

namespace mvstudio::calib {

/// A single wrong property of one camera.
enum class CameraFault {
  kNone,
  kPose,         ///< it was rotated or translated
  kFocal,        ///< its focal length is wrong
  kImage,        ///< its images were resized about their corner
  kImageWidth,   ///< … in width only
  kImageHeight,  ///< … in height only
};

/// What is adjusted in each group of parameters of a rig.
struct KeypointPlan {
  bool free_poses = false;
  CameraFault fault = CameraFault::kNone;  ///< of one camera alone, if nothing else is free
  int fault_camera = -1;
  bool free_focal = false;      ///< of every camera, with the ratio of fx and fy fixed
  bool free_image = false;      ///< scale of the images in width and height about their corner, for images that were resized
  bool free_principal = false;  ///< of every camera
  enum class Distortion { kKeep, kDrop, kFree } distortion = Distortion::kKeep;  ///< free: the first radial term

  bool Changes() const { return free_poses || fault != CameraFault::kNone; }
  bool MovesLenses() const { return free_focal || free_image || free_principal || distortion != Distortion::kKeep; }
};

/// "pose", "focal-length", "image-scale", "image-width", "image-height"; "none".
const char* ToString(CameraFault fault);
/// "keep", "drop", "free".
const char* ToString(KeypointPlan::Distortion distortion);

/// The rig with the plan's initial lenses: pinholes where distortion is dropped, and a radial term added where it is freed
/// and the model has none.
geometry::Rig StartOf(const geometry::Rig& given, const KeypointPlan& plan);

/// The freedom of this fault alone; everything else is fixed.
KeypointFreedom FreedomOfFault(const geometry::Rig& rig, CameraFault fault, int camera_idx);

/// Free unknowns of the plan; `rig` has the lenses of StartOf.
KeypointFreedom FreedomOf(const geometry::Rig& rig, const KeypointPlan& plan);

/// One candidate for one group.
struct KeypointDecision {
  std::string group, choice;
  double holdout_px = 0;         ///< length whose cost is the mean cost of the held-out residuals
  double standard_error_px = 0;  ///< of its difference to the best of the group; 0 for the best
  bool chosen = false;
  std::string refusal;  ///< why it is out whatever the held-out error says, one line; of lenses
};

template <class Visitor>
void VisitFields(Visitor&& visit, const KeypointDecision& r) {
  visit("group", r.group);
  visit("choice", r.choice);
  visit("holdout_px", r.holdout_px);
  visit("standard_error", r.standard_error_px);
  visit("chosen", r.chosen);
  visit("refusal", r.refusal);
}

struct KeypointChoice {
  KeypointPlan plan;
  std::vector<KeypointDecision> decisions;
};

struct KeypointChoiceOptions {
  int num_folds = 5;
  double sigmas = 2;        ///< standard errors by which a change must lower the held-out error; with five groups, one standard
                            ///< error (Breiman et al., 1984) would accept a change by chance in every second take
  int gap_frames = 30;      ///< minimum number of frames between a fold's interval and the others, see CutWithGaps
  double gain = 0.002;      ///< relative gain in held-out error below which a change is not worthwhile
  bool poses_only = false;  ///< do not test the lenses
};

/// Cross-validation over intervals of time: the joints of each interval are explained by a rig from the others, with a gap
/// between them. Every candidate is adjusted to all joints and then, interval by interval, without them (SolveWithout).
/// Frames are thinned evenly to about 12,000 observations.
///
/// Groups are decided one after the other: poses, focal lengths, image scale, principal points, distortion. Of the choices
/// within `sigmas` standard errors of the best (differences by intervals of time, two per fold), or within `gain`, the
/// smallest change wins. Changes of lenses must also pass VoteOnLenses: pixels of one volume alone cannot tell a wrong lens
/// from bent space.
///
/// `start` gives the initial poses, `cauchy_px` is the noise, see KeypointCost. `faults` are further candidates for the
/// poses, smallest change first, all smaller than freeing all poses.
KeypointChoice ChooseKeypointPlan(const geometry::Rig& given, const geometry::Rig& start,
                                  const std::vector<KeypointJoint>& joints, double cauchy_px,
                                  const std::vector<KeypointPlan>& faults, const KeypointChoiceOptions& options,
                                  const RunContext& run);

}  // namespace mvstudio::calib
