#pragma once

#include <Eigen/Core>
#include <vector>

#include "avatar/body/body_template.h"
#include "avatar/body/mannequin_shape.h"

/// Charts and skin weights of the mannequin: internal to the module. Positions are those of the 1.75 m rest mesh.
namespace mvstudio::body {

/// Bones of the mannequin, in this order.
enum MannequinBone {
  kPelvis,
  kSpine,
  kChest,
  kNeck,
  kHeadBone,
  kClavicleL,
  kUpperArmBoneL,
  kForearmBoneL,
  kHandBoneL,
  kClavicleR,
  kUpperArmBoneR,
  kForearmBoneR,
  kHandBoneR,
  kThighBoneL,
  kShinBoneL,
  kFootBoneL,
  kThighBoneR,
  kShinBoneR,
  kFootBoneR
};
inline constexpr int kNumMannequinBones = 19;

/// Fills face_part and face_uv.
void BuildAtlas(const std::vector<Tube>& tubes, BodyTemplate* body);
/// Fills skin_bones and skin_weights.
void BuildSkinWeights(const std::vector<Tube>& tubes, BodyTemplate* body);

}  // namespace mvstudio::body
