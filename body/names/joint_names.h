#pragma once

#include <string>
#include <vector>

#include "body/skeleton.h"

/// Joints and skeletons by the spellings of other programs.
namespace mvstudio::body {

/// Equal for spellings of one joint: case, "_", "-", "." and blanks do not matter, nor where and how the side is written:
/// "LShoulder", "left_shoulder", "shoulder.L", "Left Shoulder". Words of COCO-WholeBody, Halpe and Panoptic for joints that
/// OpenPose calls otherwise become OpenPose's: "bodycenter" is "midhip", "left_forefinger1" is "lindex1".
std::string JointKey(const std::string& name);

/// The joint of that name, else the only one with its JointKey; -1: there is none, or several.
int FindJoint(const Skeleton& skeleton, const std::string& name);

/// For a message: "joint `X` is not in skeleton S; did you mean `Y`? Its joints are A, B, …".
std::string UnknownJoint(const Skeleton& skeleton, const std::string& name);

/// Two of `names` that are the same joint of the skeleton, as "`a` and `b`"; empty: there are none.
std::string TwiceTheSameJoint(const Skeleton& skeleton, const std::vector<std::string>& names);

/// Equal for spellings of one skeleton: "BODY_25B", "body25b", "Coco-17".
std::string SkeletonKey(const std::string& name);

}  // namespace mvstudio::body
