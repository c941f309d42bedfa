#pragma once

#include <array>
#include <string>
#include <vector>

#include "avatar/run/render/render_pose.h"
#include "dataset/pose/bvh_file.h"

/// Converts animation files to Panoptic's joints.
namespace mvstudio::avatar {

using dataset::BvhClip;
using dataset::BvhFromText;
using dataset::BvhPlacement;
using dataset::PlaceJoints;
using dataset::ReadBvh;

/// Nose, left eye, left ear, right eye, right ear relative to the neck, in the axes of the trunk (left, up, forward) with
/// the head straight; metres. Animation files have at most one joint in the head.
struct HeadShape {
  std::array<Eigen::Vector3d, 5> offset_m;
  double trunk_m = 0.5;  ///< neck to BodyCenter of the same person
};
/// Measures the poses of a person: the median shape of the head, in its mean direction. An adult's where no pose shows the
/// head.
HeadShape MeasureHead(const std::vector<dataset::Coco19Pose>& poses);

/// Index of the clip's joint for each of the 19; -1: none. Names are matched by side and part ("LeftForeArm",
/// "mixamorig:LeftForeArm", "forearm.L", "lElbow", "LElbow"); a "Shoulder" is the collar bone if there is also an "Arm".
std::array<int, 19> MatchJoints(const BvhClip& clip);

/// The clip as poses in our axes (z up; the file's up axis follows from the trunk) and the file's unit, frames from 0.
/// BodyCenter is the middle of the hips and Neck that of the shoulders where the file lacks them; missing nose, eyes and
/// ears follow the head. Throws FormatError naming missing joints that are required: shoulders, elbows, wrists, hips,
/// knees, ankles.
PoseTrack PosesFromBvh(const BvhClip& clip, const HeadShape& head, const std::string& path);

}  // namespace mvstudio::avatar
