#pragma once

namespace mvstudio::body {

/// What a bone of a template is to the body. A template whose roles are complete (avatar/body/role_bones.h) is posed, textured
/// and measured without knowing its names.
enum class BoneRole {
  kOther,  ///< follows its parent: fingers, toes, jaw, twist bones
  kPelvis,
  kSpine,
  kChest,
  kNeck,
  kHead,
  kLeftClavicle,
  kLeftUpperArm,
  kLeftForearm,
  kLeftHand,
  kLeftThigh,
  kLeftShin,
  kLeftFoot,
  kRightClavicle,
  kRightUpperArm,
  kRightForearm,
  kRightHand,
  kRightThigh,
  kRightShin,
  kRightFoot
};
inline constexpr int kNumBoneRoles = 20;

}  // namespace mvstudio::body
