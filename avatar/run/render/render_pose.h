#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "avatar/run/pack/frame_runs.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/pose3d.h"

/// Poses for an avatar: from its own dataset, from another take or person, or from animation files.
namespace mvstudio::avatar {

/// One person in temporal order.
struct PoseTrack {
  std::string source;       ///< file or folder, for messages
  std::vector<int> frames;  ///< ascending
  std::vector<dataset::Coco19Pose> poses;
  double rate_hz = 0;       ///< frame numbers per second; 0: unknown
  std::string beyond = {};  ///< of SelectFrames: what was asked for and is not there, see KnownFrames
};

/// The person's poses in a dataset.
PoseTrack TrackOf(const dataset::PanopticDataset& data, int person);

/// Poses from a Panoptic sequence or its folder of body3DScene files, one such file, or a folder with points.csv (`pose3d`).
/// `person`: id, or -1 for the one with most frames. Throws IoError, FormatError, UsageError (no such person).
PoseTrack ReadPoseTrack(const std::string& path, int person);

/// The poses of `frames` (all when empty), every `step`-th of them. Throws what KnownFrames does.
PoseTrack SelectFrames(const PoseTrack& track, const std::vector<int>& frames, int step);

/// Size and position of a person.
struct SkeletonSize {
  /// Of each of avatar::kBones over the poses: median, 5th and 95th percentile; NaN: never seen.
  std::array<double, 18> length_m{}, short_m{}, long_m{};
  Eigen::Vector3d ground = Eigen::Vector3d::Constant(0);  ///< median x and y of BodyCenter, 2nd percentile of the ankles' z
};
SkeletonSize MeasureSkeleton(const std::vector<dataset::Coco19Pose>& poses);

/// Scale from the other person's metres to the trained person's: sum of `trained`'s bone lengths over that of `other`'s,
/// for the bones that both have. Uses only arms and legs if available, because spine, neck and shoulders change their
/// length with the pose. Throws FormatError naming `source` when they share no bone of any length.
double SizeRatio(const SkeletonSize& trained, const SkeletonSize& other, const std::string& source);

/// Gives a pose the trained person's bone lengths. Every bone keeps its direction and its length times `ratio`, limited to
/// the 5th and 95th percentile of training. Rigid bones thus get their one length, and a bent neck stays bent.
///
/// The root's position is multiplied by `ratio` (about the world's origin, which lies on the floor), and so are joints
/// whose parent is missing, about the nearest existing ancestor. A joint at the end of a bone more than three times too
/// long is dropped. Poses that differ by a factor about the origin give the same result.
dataset::Coco19Pose NormaliseScale(const dataset::Coco19Pose& pose, const SkeletonSize& trained, double ratio);

/// Moves every joint.
void Shift(PoseTrack* track, const Eigen::Vector3d& by_m);

}  // namespace mvstudio::avatar
