#include "avatar/body/role_bones.h"

#include "core/check.h"
#include "core/fields.h"

namespace mvstudio::body {
namespace {

constexpr ChoiceWords<BoneRole, kNumBoneRoles> kRoles = {{{BoneRole::kOther, "other"},
                                                          {BoneRole::kPelvis, "pelvis"},
                                                          {BoneRole::kSpine, "spine"},
                                                          {BoneRole::kChest, "chest"},
                                                          {BoneRole::kNeck, "neck"},
                                                          {BoneRole::kHead, "head"},
                                                          {BoneRole::kLeftClavicle, "left clavicle"},
                                                          {BoneRole::kLeftUpperArm, "left upper arm"},
                                                          {BoneRole::kLeftForearm, "left forearm"},
                                                          {BoneRole::kLeftHand, "left hand"},
                                                          {BoneRole::kLeftThigh, "left thigh"},
                                                          {BoneRole::kLeftShin, "left shin"},
                                                          {BoneRole::kLeftFoot, "left foot"},
                                                          {BoneRole::kRightClavicle, "right clavicle"},
                                                          {BoneRole::kRightUpperArm, "right upper arm"},
                                                          {BoneRole::kRightForearm, "right forearm"},
                                                          {BoneRole::kRightHand, "right hand"},
                                                          {BoneRole::kRightThigh, "right thigh"},
                                                          {BoneRole::kRightShin, "right shin"},
                                                          {BoneRole::kRightFoot, "right foot"}}};

int OnlyBone(const BodyTemplate& body, BoneRole role) {
  int found = -1;
  for (size_t b = 0; b < body.bone_roles.size(); ++b) {
    if (body.bone_roles[b] != role) continue;
    MVS_CHECK(found < 0, "bones " << found << " and " << b << " both have role " << static_cast<int>(role));
    found = static_cast<int>(b);
  }
  MVS_CHECK(found >= 0, "no bone has role " << static_cast<int>(role));
  return found;
}

bool Descends(const BodyTemplate& body, int bone, int ancestor) {
  while (bone >= 0 && bone != ancestor) bone = body.bone_parents[bone];
  return bone >= 0;
}

/// Bones of these roles, in the order of the bones: parents come first.
std::vector<int> Chain(const BodyTemplate& body, BoneRole first, BoneRole second, int below) {
  std::vector<int> chain;
  for (size_t b = 0; b < body.bone_roles.size(); ++b) {
    if (body.bone_roles[b] != first && body.bone_roles[b] != second) continue;
    MVS_CHECK(Descends(body, static_cast<int>(b), below), "bone " << b << " does not descend from bone " << below);
    chain.push_back(below = static_cast<int>(b));
  }
  MVS_CHECK(!chain.empty(), "no bone has role " << static_cast<int>(first));
  return chain;
}

}  // namespace

std::string_view ToString(BoneRole role) { return WordOf(kRoles, role); }

RoleBones FindRoleBones(const BodyTemplate& body) {
  MVS_CHECK(body.bone_roles.size() == body.bone_names.size(), body.bone_roles.size()
                                                                  << " roles for " << body.bone_names.size() << " bones");
  RoleBones bones;
  bones.pelvis = OnlyBone(body, BoneRole::kPelvis);
  bones.head = OnlyBone(body, BoneRole::kHead);
  bones.spine = Chain(body, BoneRole::kSpine, BoneRole::kChest, bones.pelvis);
  bones.neck = Chain(body, BoneRole::kNeck, BoneRole::kNeck, bones.spine.back());
  bones.arms = {{{OnlyBone(body, BoneRole::kLeftClavicle), OnlyBone(body, BoneRole::kLeftUpperArm),
                  OnlyBone(body, BoneRole::kLeftForearm), OnlyBone(body, BoneRole::kLeftHand)},
                 {OnlyBone(body, BoneRole::kRightClavicle), OnlyBone(body, BoneRole::kRightUpperArm),
                  OnlyBone(body, BoneRole::kRightForearm), OnlyBone(body, BoneRole::kRightHand)}}};
  bones.legs = {
      {{OnlyBone(body, BoneRole::kLeftThigh), OnlyBone(body, BoneRole::kLeftShin), OnlyBone(body, BoneRole::kLeftFoot)},
       {OnlyBone(body, BoneRole::kRightThigh), OnlyBone(body, BoneRole::kRightShin), OnlyBone(body, BoneRole::kRightFoot)}}};
  return bones;
}

std::vector<BoneRole> InheritedRoles(const BodyTemplate& body) {
  std::vector<BoneRole> roles = body.bone_roles;
  for (size_t b = 0; b < roles.size(); ++b) {
    if (roles[b] != BoneRole::kOther) continue;
    const int parent = body.bone_parents[b];
    roles[b] = parent < 0 ? BoneRole::kPelvis : roles[parent];
  }
  return roles;
}

}  // namespace mvstudio::body
