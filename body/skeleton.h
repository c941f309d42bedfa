#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

namespace mvstudio::body {

/// A named list of joints and the bones between them.
struct Skeleton {
  std::string name;                 // "body25", "body25b", "coco17", "coco18", "coco19"
  std::vector<std::string> joints;  // OpenPose's names: "Nose", "RHip", "LBigToe", "MidHip", …; coco19 uses Panoptic's order
  std::vector<std::pair<int, int>> bones;  // indices into joints

  int Find(const std::string& joint) const;  // -1 when absent
};

/// Throws UsageError that lists the known names.
const Skeleton& SkeletonByName(const std::string& name);
std::vector<std::string> SkeletonNames();

/// CMU Panoptic's 19 joints: Neck, Nose, BodyCenter, lShoulder, lElbow, lWrist, lHip, lKnee, lAnkle, rShoulder, rElbow, rWrist,
/// rHip, rKnee, rAnkle, lEye, lEar, rEye, rEar. Here by OpenPose's names (BodyCenter = "MidHip", lShoulder = "LShoulder", …).
const Skeleton& Coco19();

/// For each of the 19 Panoptic joints, the joints of `from` whose mean it is (one, or two for Neck and BodyCenter where the
/// source has none of its own); empty when it cannot be had. BODY_25B's "Neck" is the upper neck, so Neck is the mean of the
/// shoulders there.
std::array<std::vector<int>, 19> Coco19From(const Skeleton& from);

}  // namespace mvstudio::body
