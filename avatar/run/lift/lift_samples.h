#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "avatar/run/lift/lift_input.h"
#include "core/fields.h"
#include "core/random.h"
#include "dataset/panoptic/panoptic.h"

namespace mvstudio::avatar {

/// Simulation of camera and detector on 3D poses.
struct LiftSampleOptions {
  double pose_jitter_deg = 20.0;
  double min_distance = 2.5;
  double max_distance = 10.0;
  double min_pitch_deg = -15.0;
  double max_pitch_deg = 50.0;
  double noise = 0.012;
  double bias = 0.015;
  double drop = 0.05;
};

template <class Visitor>
void VisitFields(Visitor&& visit, LiftSampleOptions& o) {
  visit("pose-jitter-deg", o.pose_jitter_deg,
        "degrees; standard deviation of random rotations of trunk and limbs, for poses that the datasets do not contain; 0: "
        "none");
  visit("min-distance", o.min_distance, "nearest random camera, in sizes (trunk + thigh + shank, 0.78 of the height)");
  visit("max-distance", o.max_distance, "farthest random camera, in sizes");
  visit("min-pitch-deg", o.min_pitch_deg, "degrees; lowest random camera, negative looks up");
  visit("max-pitch-deg", o.max_pitch_deg, "degrees; highest random camera");
  visit("noise", o.noise, "standard deviation of a detection that differs from frame to frame, in sizes");
  visit("bias", o.bias, "standard deviation of a detection that is the same in all five frames, in sizes");
  visit("drop", o.drop, "share of joints that are dropped in all five frames, and again in each single frame");
}

/// Throws UsageError naming the option.
void Validate(const LiftSampleOptions& options);

/// Consecutive frames of one person; a frame without the person has no valid joint.
struct LiftSequence {
  std::string name;  ///< for messages
  std::vector<dataset::Coco19Pose> frames;
  double size_m = 0;        ///< median over the frames of trunk + thigh + shank, metres
  std::vector<int> middle;  ///< indices of usable frames: the root and at least 6 joints
};

/// Sum of the lengths from neck to the middle of the hips, of thigh and of shank (0.779 of a person's height: Drillis and
/// Contini, Body Segment Parameters, 1966); limbs are the mean of left and right. NaN when one of the three is missing on
/// both sides.
double SizeOf(const dataset::Coco19Pose& pose);
inline constexpr double kSizePerHeight = 0.779;

/// Median of the known sizes; 0 without any.
double MedianSize(const std::vector<dataset::Coco19Pose>& poses);

/// Every person of the dataset, without the frames `leave_out_frames`; people without a usable frame are left out. No
/// window reaches across a cut (dataset/pose/cuts.h).
std::vector<LiftSequence> LiftSequences(const dataset::PanopticDataset& data, const std::vector<int>& leave_out_frames);

/// A training pose: the detector's output, and the joints of the middle frame relative to the root in the view's axes, in
/// sizes.
struct LiftSample {
  LiftInput input;
  Eigen::Matrix<double, 3, kLiftJoints> target = Eigen::Matrix<double, 3, kLiftJoints>::Zero();
  std::array<bool, kLiftJoints> valid{};
};

/// A random pose of the sequences seen by a random level camera. Mirrored half of the time, with every frame or every
/// second one, forwards or backwards; noise and missing joints as in the options. Every sample has status kOk.
LiftSample RandomSample(const std::vector<LiftSequence>& sequences, const LiftSampleOptions& options, Rng& rng);

/// Joints of `pose` relative to the root, in the axes of the view, divided by `size_m`.
LiftSample TargetOf(const dataset::Coco19Pose& pose, const Eigen::Matrix3d& view_from_world, double size_m);

}  // namespace mvstudio::avatar
