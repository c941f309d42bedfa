#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

/// The joints of each bone. No tensors here.
namespace mvstudio::avatar {

/// The 18 bones between Panoptic's 19 joints, one input channel each (Shysheya et al., "Textured Neural Avatars", CVPR 2019).
inline constexpr std::array<std::pair<int, int>, 18> kBones = {{{0, 1},
                                                                {1, 15},
                                                                {15, 16},
                                                                {1, 17},
                                                                {17, 18},
                                                                {0, 2},
                                                                {0, 9},
                                                                {9, 10},
                                                                {10, 11},
                                                                {0, 3},
                                                                {3, 4},
                                                                {4, 5},
                                                                {2, 6},
                                                                {6, 7},
                                                                {7, 8},
                                                                {2, 12},
                                                                {12, 13},
                                                                {13, 14}}};
inline constexpr int64_t kNumBones = 18;

/// Joints are given as one of four lists, identified by their number: 19 (Panoptic), 25 (OpenPose's BODY_25), 131 and 137.
/// The last two are the first two followed by the 70 points of the face, the 21 of the left hand and the 21 of the right
/// hand (OpenPose's orders).
inline constexpr int kFaceJoints = 70, kHandJoints = 21, kExtraJoints = kFaceJoints + 2 * kHandJoints;
constexpr bool IsJointList(int64_t num_joints) {
  return num_joints == 19 || num_joints == 25 || num_joints == 19 + kExtraJoints || num_joints == 25 + kExtraJoints;
}
/// 19 or 25: those of the body.
constexpr int NumBodyJoints(int64_t num_joints) { return num_joints == 25 || num_joints == 25 + kExtraJoints ? 25 : 19; }
/// BodyCenter, MidHip.
constexpr int CenterJoint(int64_t num_joints) { return NumBodyJoints(num_joints) == 25 ? 8 : 2; }

/// A line between two joints; it is drawn when all of `needs` exist.
struct BoneLine {
  int a = 0, b = 0;
  std::vector<int> needs;
};

/// One input channel.
struct InputMap {
  std::string name;  ///< "bone 3", "left hand", "right hand", "face"
  std::vector<BoneLine> lines;
  bool thin = false;  ///< half as wide as bones: hands and face
};

/// Input of a network with a given number of channels.
struct InputLayout {
  int num_joints = 19;  ///< the list of joints that has all it can use
  bool slopes = false;  ///< a second set of channels, see RasterizeSlopes
  std::vector<InputMap> maps;
};

/// 18: Panoptic's bones; 21: also the hands and the face; 24: BODY_25's bones; 27: also the hands and the face; 36: as 18,
/// with slopes. A finger needs its five joints. Bones of BODY_25 and the order of channels are those of the published
/// program of Shysheya et al. Throws UsageError for other numbers.
const InputLayout& LayoutOf(int inputs);

}  // namespace mvstudio::avatar
