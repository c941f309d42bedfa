#pragma once

#include <string>
#include <vector>

#include "calib/keypoints/bundle.h"
#include "core/progress.h"

namespace mvstudio::calib {

/// One thing of one camera.
enum class CameraFault {
  kNone,
  kPose,         ///< it was turned or moved
  kFocal,        ///< its focal length is wrong
  kImage,        ///< its pictures were resized, about their corner
  kImageWidth,   ///< … across only
  kImageHeight,  ///< … down only
};

/// What is done to each group of parameters of a rig.
struct KeypointPlan {
  bool free_poses = false;
  CameraFault fault = CameraFault::kNone;  ///< of one camera alone, where no other freedom is set
  int fault_camera = -1;
  bool free_focal = false;      ///< of every camera, fx and fy in their ratio
  bool free_image = false;      ///< scale of the pictures across and down about their corner: pictures that were resized
  bool free_principal = false;  ///< of every camera
  enum class Distortion { kKeep, kDrop, kFree } distortion = Distortion::kKeep;  ///< free: the first radial term

  bool Changes() const { return free_poses || fault != CameraFault::kNone; }
  bool MovesLenses() const { return free_focal || free_image || free_principal || distortion != Distortion::kKeep; }
};

/// "pose", "focal-length", "image-scale", "image-width", "image-height"; "none".
const char* ToString(CameraFault fault);
/// "keep", "drop", "free".
const char* ToString(KeypointPlan::Distortion distortion);

/// The rig with the lenses that the plan starts from: pinholes where distortion is dropped, a radial term where it is freed and
/// there is none.
geometry::Rig StartOf(const geometry::Rig& given, const KeypointPlan& plan);

/// That alone may move; all other numbers are held.
KeypointFreedom FreedomOfFault(const geometry::Rig& rig, CameraFault fault, int camera_idx);

/// What may move under the plan; `rig` has the lenses of StartOf.
KeypointFreedom FreedomOf(const geometry::Rig& rig, const KeypointPlan& plan);

/// One candidate for one group.
struct KeypointDecision {
  std::string group, choice;
  double holdout_px = 0;         ///< length whose cost is the mean cost of the held-out residuals
  double standard_error_px = 0;  ///< of its difference to the best of the group; 0 for the best
  bool chosen = false;
};

struct KeypointChoice {
  KeypointPlan plan;
  std::vector<KeypointDecision> decisions;
};

struct KeypointChoiceOptions {
  int num_folds = 5;
  double sigmas = 2;  ///< standard errors by which a change must lower the held-out error: five groups are asked, a rule of one
                      ///< standard error (Breiman et al., 1984) would let one of them through by chance in every second take
  int gap_frames = 30;      ///< frames between a stretch and the others at least, see CutWithGaps
  double gain = 0.002;      ///< part of the held-out error below which a change is not worth it
  bool poses_only = false;  ///< the lenses are not asked for
};

/// Cross-validation over stretches of the joints' time: a rig from the other stretches explains the joints of each, with a gap
/// between them. Every candidate is adjusted to all of them and then, stretch by stretch, without (SolveWithout). Of many
/// frames so many are used, evenly spread, as hold 12,000 observations. Groups are decided one after the other (poses, focal
/// lengths, image scale, principal points, distortion); of the choices within `sigmas` standard errors of the best (differences
/// by stretches of time, two a fold), or `gain`, the one that changes least wins. `start` gives the poses to start from,
/// `cauchy_px` is the noise, see KeypointCost. `faults` are further choices for the poses, from the least change on, all less
/// than setting all of them free.
KeypointChoice ChooseKeypointPlan(const geometry::Rig& given, const geometry::Rig& start,
                                  const std::vector<KeypointJoint>& joints, double cauchy_px,
                                  const std::vector<KeypointPlan>& faults, const KeypointChoiceOptions& options,
                                  const RunContext& run);

}  // namespace mvstudio::calib
