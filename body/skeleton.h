#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

namespace mvstudio::body {

/// Consecutive joints that a detector returns as one list.
struct SkeletonPart {
  enum class Kind { kBody, kFace, kLeftHand, kRightHand };
  Kind kind = Kind::kBody;
  int first = 0, count = 0;  // indices into Skeleton::joints
};

/// A named list of joints and the bones between them.
///
/// Names: "body25", "body25b", "body135" (OpenPose), "coco17", "coco18", "coco19" (CMU Panoptic's joints19), "coco133"
/// (COCO-WholeBody), "halpe26", "halpe136", "mediapipe33" (MediaPipe Pose), "mediapipe75" (with its left and right hand),
/// "openpose137" (BODY_25, face, left hand, right hand). OpenPose's bodies also exist with its other lists: "body25+face",
/// "body25+hands", "body25+face+hands", and the same of body25b and coco18.
struct Skeleton {
  std::string name;
  std::vector<std::string> joints;  // OpenPose's names: "Nose", "RHip", "LBigToe", "MidHip", …; "Face0" … "Face69" (the 68 of
                                    // 300-W and the pupils); "LHandWrist", "LThumb1" … "LThumb4" (tip), "LIndex1", …
  std::vector<std::pair<int, int>> bones;  // indices into joints
  std::vector<SkeletonPart> parts = {};    // how OpenPose's JSON splits it; empty: all joints are one list

  int Find(const std::string& joint) const;  // -1 when absent
};

/// Throws UsageError that lists the known names.
const Skeleton& SkeletonByName(const std::string& name);
std::vector<std::string> SkeletonNames();

/// Names of the skeletons with this number of joints.
std::vector<std::string> SkeletonsOfSize(size_t num_joints);

/// Free points (markers, animals): the name is "points", there are no bones.
Skeleton PointsSkeleton(std::vector<std::string> joints);

/// The skeleton of that name if it has all of `joints`, else a PointsSkeleton of them.
Skeleton SkeletonOrPoints(const std::string& name, const std::vector<std::string>& joints);

/// Pairs (left, right) of joints that a mirror exchanges. Found by name: "LKnee" / "RKnee", and for names of other
/// programs "left_knee", "knee_left", "knee_l", "knee.L", "Left knee"; "Face…" by position in the face.
std::vector<std::pair<int, int>> MirrorJoints(const Skeleton& skeleton);

/// The same pairs in groups that detectors swap separately: head, arms with hands, legs with feet, and the rest; without
/// empty groups.
std::vector<std::vector<std::pair<int, int>>> MirrorGroups(const Skeleton& skeleton);

/// CMU Panoptic's 19 joints: Neck, Nose, BodyCenter, lShoulder, lElbow, lWrist, lHip, lKnee, lAnkle, rShoulder, rElbow, rWrist,
/// rHip, rKnee, rAnkle, lEye, lEar, rEye, rEar. Here by OpenPose's names (BodyCenter = "MidHip", lShoulder = "LShoulder", …).
const Skeleton& Coco19();

/// For each of the 19 Panoptic joints, the joints of `from` whose mean it is: one, or two for Neck and BodyCenter where
/// the source lacks them. Empty when it cannot be derived. The "Neck" of a skeleton that also has the "Head" (BODY_25B,
/// BODY_135, Halpe) is the upper neck, so Neck is then the mean of the shoulders.
std::array<std::vector<int>, 19> Coco19From(const Skeleton& from);

}  // namespace mvstudio::body
