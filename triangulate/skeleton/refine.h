#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/choice/auto_on_off.h"
#include "core/progress.h"
#include "triangulate/point/holdout.h"
#include "triangulate/take/take.h"

/// Joint refinement of a take with constraints on bodies that single points lack. Each term is used only if left-out
/// cameras support it.
namespace mvstudio::triangulate {

struct SkeletonRefineOptions {
  AutoOnOff robust = AutoOnOff::kAuto;
  AutoOnOff smoothness = AutoOnOff::kAuto;
  AutoOnOff bone_lengths = AutoOnOff::kAuto;
  int max_fill_frames = 10;
  double max_fill_sigmas = 3;
  int choice_frames = 120;
  int choice_cameras = 5;
};

template <class Visitor>
void VisitFields(Visitor&& visit, SkeletonRefineOptions& o) {
  visit("refine-robust", o.robust,
        "auto | on | off; every detection counts, weighted down by a Cauchy loss, instead of chosen ones");
  visit("refine-smoothness", o.smoothness, "auto | on | off; accelerations of each joint are small");
  visit("refine-bone-lengths", o.bone_lengths, "auto | on | off; each bone of a person keeps its length");
  visit("refine-max-fill-frames", o.max_fill_frames,
        "frames; longest gap to a time step with that joint which smoothness may fill");
  visit("refine-max-fill-sigmas", o.max_fill_sigmas,
        "a filled joint is kept up to this many times the median uncertainty of the observed ones");
  visit("refine-choice-frames", o.choice_frames, "frames on which terms are chosen, in three runs");
  visit("refine-choice-cameras", o.choice_cameras, "cameras left out in turn to choose terms");
}

/// One weight that was tried.
struct TermTrial {
  std::string name;   ///< "robust", "smoothness", "bone-lengths"
  double weight = 0;  ///< robust: 1; smoothness: accelerations' sigma over their typical size in the take, 1 … 0.03;
                      ///< bone-lengths: sigma of a length over the length, 0.1 … 0.003
  LeftOutFigures before, after;  ///< without the term and with it, over the same held-out detections
  PairedDifference difference;   ///< after minus before
  bool better = false;  ///< median lower by more than its standard error, and 90 % quantile not higher by more than its own
  bool chosen = false;
};

struct BoneReport {
  int person = 0, joint_a = 0, joint_b = 0;
  int num_frames = 0;                          ///< in which both joints are kOk before and after
  double length_m = 0;                         ///< median before, or the estimate where the term is used
  double sigma_m = 0;                          ///< standard deviation of the estimate; 0 where the term is not used
  double std_before_mm = 0, std_after_mm = 0;  ///< standard deviation of the length over these frames
};

struct SkeletonRefineReport {
  std::vector<TermTrial> trials;                        ///< in the order tried, chosen or not
  double robust = 0, smoothness = 0, bone_lengths = 0;  ///< weights in use, 0: not used
  LeftOutFigures before, after;  ///< held-out figures without terms, and with all chosen terms (covariances as reported)
  double shared_error = 0;       ///< 0..1, see RefineSkeleton
  std::vector<BoneReport> bones;
  double limb_std_before_mm = 0, limb_std_after_mm = 0;  ///< means over the bones with 5 frames or more; NaN without any
  int num_filled = 0;                                    ///< joints that became kOk
  int num_unrefined_frames = 0;                          ///< of all persons; kept as they were, their equations are singular
};

struct SkeletonRefineResult {
  std::vector<TakePoint> points;  ///< in the order of the take's
  SkeletonRefineReport report;
};

/// Refines the joints of each person of a take by Gauss-Newton on the reprojection residuals of all frames together. Time and
/// memory grow with the number of frames: takes of more than 600 frames are solved in stretches of 600, each together with
/// 20 frames on both sides, whose solution counts for their neighbours (docs/triangulation.md says what that changes); the
/// median of their lengths then holds for all. Terms:
///   - robust: all detections under a Cauchy loss at 2 sigmas, instead of those used for the point.
///   - smoothness: accelerations (second divided differences, in m / frame^2, so no frame rate is needed) are normal
///     with a sigma that is a fraction of the joint's median acceleration in the take; Cauchy at 3 sigmas, because feet
///     hit the floor. Unseen joints are bridged between observations at most `max_fill_frames` away on both sides. A cut
///     (the joints' median way since the frame before is above 0.5 m + 0.1 m / frame) is not bridged.
///   - bone-lengths: |x_a - x_b| is normal about one unknown length per bone and person, Cauchy at 3 sigmas.
///
/// `auto` tries the terms in this order over a grid of weights, each together with those already chosen. Cameras are left
/// out one at a time, `solve` triangulates from the others, and the terms refine. A term is kept if it predicts the
/// left-out detections better by more than one standard error; of weights as good as the best, the weakest is taken. So
/// bones of a person that the calibration stretches are not forced to one length.
///
/// Covariances are those of the whole problem (selected inverse of the normal matrix; Takahashi et al., 1973), given the
/// weights, plus the contribution of the calibration to the point. Persistent errors, as those of a calibration without
/// covariance, do not average out over time. The covariance therefore keeps a part of the single point's covariance
/// (`shared_error`): the smallest with which the left-out detections lie no farther, in sigmas, than expected or than
/// before.
///
/// A bridged joint becomes kOk only if its largest standard deviation is within `max_fill_sigmas` of the median of that
/// joint's; all others keep their status. Without any term, points stay unchanged.
///
/// `bones`: pairs of joint indices. `solve`: the solver that triangulated the take. Throws UsageError for options out of
/// range.
SkeletonRefineResult RefineSkeleton(const PreparedRig& rig, const TakeResult& take,
                                    const std::vector<std::pair<int, int>>& bones, const PointSolver& solve,
                                    const SkeletonRefineOptions& options, const RunContext& run = {});

}  // namespace mvstudio::triangulate
