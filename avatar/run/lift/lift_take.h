#pragma once

#include <map>
#include <vector>

#include "avatar/lift/lift.h"
#include "avatar/run/lift/lift_score.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig.h"

namespace mvstudio::avatar {

/// Samples for TrainLifter: functions only of `seed` and the index.
LiftSampler SamplerOf(const std::vector<LiftSequence>& sequences, const LiftSampleOptions& options, uint64_t seed);

struct LiftedFrame {
  Status status = Status::kOk;
  LiftJoints x_in_cam = LiftJoints::Zero();  ///< metres
  double rms_px = 0;                         ///< of the projected joints against the detections, at the image's centre
};

/// Lifts and places every frame. One camera cannot measure size: the take's lifted poses are scaled to a median size of
/// `size_m`.
std::map<int, LiftedFrame> LiftTake(const Lifter& lifter, const std::map<int, LiftInput>& inputs, double size_m,
                                    double focal_px);

/// Smooths over time: means of neighbours that are Ok, weighted by a Gaussian of `sigma_frames` frames; 0 changes nothing.
/// Changes only the position and the pose of frames that are Ok themselves.
void SmoothTake(double sigma_frames, std::map<int, LiftedFrame>* frames);

/// Joints in world as a table of the coco19 skeleton, person 0, sigma_m of the lifter for every joint.
dataset::Pose3d ToPose3d(const std::map<int, LiftedFrame>& frames, const geometry::Rigid3& cam_from_world, double sigma_m);

/// Pairs of the first person of `truth` and the lifted frames, in the camera's axes.
std::vector<LiftPair> PairsOf(const std::map<int, LiftedFrame>& frames, const std::map<int, dataset::Coco19Pose>& truth,
                              const geometry::Rigid3& cam_from_world);

/// The lifter and the two baselines on the same views.
struct LiftComparison {
  LiftScore lifter, mean_pose, nearest;
  double sigma_m = 0;  ///< root mean square error of a root-relative coordinate of the lifter, metres
};

/// For held-out frames of a dataset, all its cameras, joints projected through their lenses with `noise_px`.
LiftComparison CompareOnHeldOut(const Lifter& lifter, const LiftBaselines& baselines,
                                const std::vector<const dataset::PanopticDataset*>& datasets,
                                const std::vector<std::vector<int>>& frames, double noise_px, uint64_t seed);

/// Same for one take with given views.
LiftComparison CompareOnTake(const Lifter& lifter, const LiftBaselines& baselines, const std::map<int, LiftInput>& inputs,
                             const std::map<int, dataset::Coco19Pose>& truth, const geometry::RigCamera& camera);

}  // namespace mvstudio::avatar
