#include "avatar/body/body_template.h"
#include "avatar/body/mannequin_atlas.h"
#include "avatar/body/mannequin_shape.h"
#include "core/check.h"

namespace mvstudio::body {
namespace {

struct BoneRow {
  const char* name;
  int parent;
  Eigen::Vector3d head, tail;
};

Eigen::Vector3d Mirror(const Eigen::Vector3d& x) { return {-x[0], x[1], x[2]}; }

void AddBones(BodyTemplate* body) {
  const MannequinJoints j;
  const BoneRow center[] = {{"pelvis", -1, j.body_center, j.hip},
                            {"spine", kPelvis, j.spine, j.chest},
                            {"chest", kSpine, j.chest, j.neck},
                            {"neck", kChest, j.neck, j.head},
                            {"head", kNeck, j.head, j.crown}};
  const BoneRow arm[] = {{"clavicle", kChest, j.clavicle, j.shoulder},
                         {"upper_arm", -1, j.shoulder, j.elbow},
                         {"forearm", -1, j.elbow, j.wrist},
                         {"hand", -1, j.wrist, j.hand_tip}};
  const BoneRow leg[] = {{"thigh", kPelvis, j.hip, j.knee}, {"shin", -1, j.knee, j.ankle}, {"foot", -1, j.ankle, j.toe_tip}};
  std::vector<BoneRow> rows(std::begin(center), std::end(center));
  std::vector<std::string> names = {"pelvis", "spine", "chest", "neck", "head"};
  auto add_chain = [&](const BoneRow* chain, int count, bool right) {
    for (int i = 0; i < count; ++i) {
      BoneRow row = chain[i];
      if (row.parent < 0) row.parent = static_cast<int>(rows.size()) - 1;
      if (right) row.head = Mirror(row.head), row.tail = Mirror(row.tail);
      rows.push_back(row);
      names.push_back(std::string(right ? "r_" : "l_") + row.name);
    }
  };
  add_chain(arm, 4, false);
  add_chain(arm, 4, true);
  add_chain(leg, 3, false);
  add_chain(leg, 3, true);
  body->bone_names = names;
  using Role = BoneRole;
  body->bone_roles = {Role::kPelvis,        Role::kSpine,        Role::kChest,       Role::kNeck,      Role::kHead,
                      Role::kLeftClavicle,  Role::kLeftUpperArm, Role::kLeftForearm, Role::kLeftHand,  Role::kRightClavicle,
                      Role::kRightUpperArm, Role::kRightForearm, Role::kRightHand,   Role::kLeftThigh, Role::kLeftShin,
                      Role::kLeftFoot,      Role::kRightThigh,   Role::kRightShin,   Role::kRightFoot};
  body->bone_heads.resize(3, rows.size());
  body->bone_tails.resize(3, rows.size());
  for (size_t b = 0; b < rows.size(); ++b) {
    body->bone_parents.push_back(rows[b].parent);
    body->bone_heads.col(b) = rows[b].head;
    body->bone_tails.col(b) = rows[b].tail;
  }
}

/// Panoptic's order: Neck, Nose, BodyCenter, left shoulder … ankle, right shoulder … ankle, lEye, lEar, rEye, rEar.
void AddJoints(BodyTemplate* body) {
  const MannequinJoints j;
  const Eigen::Vector3d limbs[] = {j.shoulder, j.elbow, j.wrist, j.hip, j.knee, j.ankle};
  body->coco19.resize(3, 19);
  body->coco19.col(0) = j.neck;
  body->coco19.col(1) = j.nose;
  body->coco19.col(2) = j.body_center;
  for (int i = 0; i < 6; ++i) {
    body->coco19.col(3 + i) = limbs[i];
    body->coco19.col(9 + i) = Mirror(limbs[i]);
  }
  body->coco19.col(15) = j.eye;
  body->coco19.col(16) = j.ear;
  body->coco19.col(17) = Mirror(j.eye);
  body->coco19.col(18) = Mirror(j.ear);
  body->coco19_bone = {kNeck,      kHeadBone,  kPelvis,        kUpperArmBoneL, kForearmBoneL, kHandBoneL,  kThighBoneL,
                       kShinBoneL, kFootBoneL, kUpperArmBoneR, kForearmBoneR,  kHandBoneR,    kThighBoneR, kShinBoneR,
                       kFootBoneR, kHeadBone,  kHeadBone,      kHeadBone,      kHeadBone};
}

}  // namespace

BodyTemplate MakeMannequin(double height_m, double detail) {
  MVS_CHECK(height_m > 0.1 && height_m < 10, "height_m = " << height_m);
  MVS_CHECK(detail >= 0.1 && detail <= 8, "detail = " << detail);
  constexpr double kRestHeight = 1.75, kStep = 0.016;
  BodyTemplate body;
  const std::vector<Tube> tubes = MannequinTubes();
  TriangleMesh mesh = MeshTubes(tubes, kStep / detail);
  body.vertices = mesh.vertices;
  body.faces = mesh.faces;
  AddBones(&body);
  AddJoints(&body);
  BuildAtlas(tubes, &body);
  BuildSkinWeights(tubes, &body);
  const double scale = height_m / kRestHeight;
  body.vertices *= static_cast<float>(scale);
  body.bone_heads *= scale;
  body.bone_tails *= scale;
  body.coco19 *= scale;
  return body;
}

}  // namespace mvstudio::body
