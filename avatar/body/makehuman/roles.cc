#include "avatar/body/makehuman/roles.h"

#include <map>

namespace mvstudio::body {
namespace {

using Role = BoneRole;

// Skeleton of CMU's motion files.
const std::map<std::string, BoneRole> kCmu = {{"Hips", Role::kPelvis},
                                              {"LowerBack", Role::kSpine},
                                              {"Spine", Role::kSpine},
                                              {"Spine1", Role::kChest},
                                              {"Neck", Role::kNeck},
                                              {"Neck1", Role::kNeck},
                                              {"Head", Role::kHead},
                                              {"LeftShoulder", Role::kLeftClavicle},
                                              {"LeftArm", Role::kLeftUpperArm},
                                              {"LeftForeArm", Role::kLeftForearm},
                                              {"LeftHand", Role::kLeftHand},
                                              {"LeftUpLeg", Role::kLeftThigh},
                                              {"LeftLeg", Role::kLeftShin},
                                              {"LeftFoot", Role::kLeftFoot},
                                              {"RightShoulder", Role::kRightClavicle},
                                              {"RightArm", Role::kRightUpperArm},
                                              {"RightForeArm", Role::kRightForearm},
                                              {"RightHand", Role::kRightHand},
                                              {"RightUpLeg", Role::kRightThigh},
                                              {"RightLeg", Role::kRightShin},
                                              {"RightFoot", Role::kRightFoot}};

const std::map<std::string, BoneRole> kGameEngine = {{"pelvis", Role::kPelvis},
                                                     {"spine_01", Role::kSpine},
                                                     {"spine_02", Role::kSpine},
                                                     {"spine_03", Role::kChest},
                                                     {"neck_01", Role::kNeck},
                                                     {"head", Role::kHead},
                                                     {"clavicle_l", Role::kLeftClavicle},
                                                     {"upperarm_l", Role::kLeftUpperArm},
                                                     {"lowerarm_l", Role::kLeftForearm},
                                                     {"hand_l", Role::kLeftHand},
                                                     {"thigh_l", Role::kLeftThigh},
                                                     {"calf_l", Role::kLeftShin},
                                                     {"foot_l", Role::kLeftFoot},
                                                     {"clavicle_r", Role::kRightClavicle},
                                                     {"upperarm_r", Role::kRightUpperArm},
                                                     {"lowerarm_r", Role::kRightForearm},
                                                     {"hand_r", Role::kRightHand},
                                                     {"thigh_r", Role::kRightThigh},
                                                     {"calf_r", Role::kRightShin},
                                                     {"foot_r", Role::kRightFoot}};

}  // namespace

BoneRole RoleOfMakeHumanBone(const std::string& name) {
  for (const auto* table : {&kCmu, &kGameEngine}) {
    const auto found = table->find(name);
    if (found != table->end()) return found->second;
  }
  return BoneRole::kOther;
}

}  // namespace mvstudio::body
