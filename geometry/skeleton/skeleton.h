#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace mvstudio::geometry {

/// Consecutive joints that a detector returns as one list.
struct SkeletonPart {
  enum class Kind { kBody, kFace, kLeftHand, kRightHand };
  Kind kind = Kind::kBody;
  int first = 0, count = 0;  // indices into Skeleton::joints
};

/// What a bone's length may be, metres.
struct LengthRange {
  double min_m = 0, max_m = std::numeric_limits<double>::infinity();
};

/// A named list of joints and the bones between them: one of those that are known by name (geometry/skeleton/known/*.toml), or
/// of a file in the same form (docs/formats.md).
///
/// Names: "body25", "body25b", "body135" (OpenPose), "coco17", "coco18", "coco19" (CMU Panoptic's joints19), "coco133"
/// (COCO-WholeBody), "halpe26", "halpe136", "mediapipe33" (MediaPipe Pose), "mediapipe75" (with its left and right hand),
/// "openpose137" (BODY_25, face, left hand, right hand). OpenPose's bodies also exist with its other lists: "body25+face",
/// "body25+hands", "body25+face+hands", and the same of body25b and coco18.
struct Skeleton {
  std::string name;
  std::vector<std::string> joints;  // known skeletons: OpenPose's names: "Nose", "RHip", "LBigToe", "MidHip", …; "Face0" …
                                    // "Face69" (the 68 of 300-W and the pupils); "LHandWrist", "LThumb1" … "LThumb4" (tip), …
  std::vector<std::pair<int, int>> bones;          // indices into joints
  std::vector<SkeletonPart> parts = {};            // how OpenPose's JSON splits it; empty: all joints are one list
  std::vector<std::pair<int, int>> pairs = {};     // (left, right) that a mirror exchanges; empty: MirrorJoints goes by names
  std::vector<LengthRange> lengths = {};           // one per bone; empty: none is stated
  std::vector<std::string> colours = {};           // one per bone, "#rrggbb" or empty; empty: none is stated
  std::vector<int> parents = {};                   // one per joint, -1 of the root; empty: HierarchyOf goes by the bones
  std::vector<std::array<double, 3>> rest_m = {};  // one per joint: from its parent at rest, x to the left, y up, z forward;
                                                   // empty: not stated
  std::vector<int> up_from = {}, up_to = {};       // up is the direction from the mean of these joints to that of those
  bool human = false;                              // limbs are judged by what people can have

  int Find(const std::string& joint) const;  // -1 when absent
};

/// Throws UsageError that lists the known names.
const Skeleton& SkeletonByName(const std::string& name);
/// Null for a name that is not known.
const Skeleton* FindSkeleton(const std::string& name);
std::vector<std::string> SkeletonNames();

/// True for a text that names a file, not a skeleton: one that ends in ".toml" or ".json", or holds a slash.
bool IsSkeletonFile(const std::string& name_or_file);
/// SkeletonByName, or the skeleton in a file. Throws UsageError; IoError or FormatError (path, key) for a file that cannot be
/// read, or that takes a known skeleton's name for other joints.
Skeleton SkeletonFrom(const std::string& name_or_file);

/// Names of the skeletons with this number of joints.
std::vector<std::string> SkeletonsOfSize(size_t num_joints);

/// Free points (markers, animals): the name is "points", there are no bones.
Skeleton PointsSkeleton(std::vector<std::string> joints);

/// The skeleton of that name if it has all of `joints`, else a PointsSkeleton of them.
Skeleton SkeletonOrPoints(const std::string& name, const std::vector<std::string>& joints);

/// True when all of `joints` are joints of the skeleton.
bool HasJoints(const Skeleton& skeleton, const std::vector<std::string>& joints);

/// Names of a bone's ends: "LHip-LKnee".
std::string BoneName(const Skeleton& skeleton, const std::pair<int, int>& bone);

/// One colour per bone, red, green, blue: as stated, else by the side that both ends are on: left, right or neither.
std::vector<std::array<uint8_t, 3>> BoneColours(const Skeleton& skeleton);

/// The parent of each joint, -1 of the only root: as stated, else a spanning tree of the bones, breadth first from the joint
/// with most bones. What no bone leads to hangs from the root. Every joint is reached.
std::vector<int> HierarchyOf(const Skeleton& skeleton);
/// The same tree from a given root, by the bones alone.
std::vector<int> SpanningTree(const Skeleton& skeleton, int root);

/// Pairs (left, right) of joints that a mirror exchanges: those stated, else found by name: "LKnee" / "RKnee", and for names of
/// other programs "left_knee", "knee_left", "knee_l", "knee.L", "Left knee"; "Face…" by position in the face.
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

}  // namespace mvstudio::geometry
