#include "avatar/body/rig_rules.h"

#include <algorithm>

#include "avatar/body/role_bones.h"
#include "core/check.h"

namespace mvstudio::body {
namespace {

constexpr int kBodyCenterJoint = 2, kHipJoints[2] = {6, 12};

void EndChain(const std::vector<int>& chain, const PointRule& end, RigRules* rules) {
  for (size_t i = 0; i < chain.size(); ++i) rules->tails[chain[i]] = i + 1 < chain.size() ? rules->heads[chain[i + 1]] : end;
}

}  // namespace

PointRule MeanRule(const std::vector<int>& vertices) {
  PointRule rule;
  for (const int v : vertices) rule.emplace_back(v, 1.0 / static_cast<double>(vertices.size()));
  return rule;
}

PointRule AddRules(PointRule a, const PointRule& b, double weight) {
  for (const auto& [vertex, w] : b) a.emplace_back(vertex, weight * w);
  return a;
}

Eigen::Vector3d ApplyRule(const PointRule& rule, const Eigen::Matrix3Xd& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& [vertex, weight] : rule) sum += weight * points.col(vertex);
  return sum;
}

void CompleteRules(const BodyTemplate& body, RigRules* rules) {
  const RoleBones bones = FindRoleBones(body);
  for (int side = 0; side < 2; ++side) {
    const auto& arm = bones.arms[side];
    const auto& leg = bones.legs[side];
    for (int i = 0; i < 3; ++i) {
      rules->tails[arm[i]] = rules->heads[arm[i + 1]];
      rules->coco19[(side == 0 ? 3 : 9) + i] = rules->heads[arm[i + 1]];
      rules->coco19[(side == 0 ? 6 : 12) + i] = rules->heads[leg[i]];
      if (i < 2) rules->tails[leg[i]] = rules->heads[leg[i + 1]];
    }
  }
  rules->coco19[kBodyCenterJoint] =
      AddRules(AddRules({}, rules->coco19[kHipJoints[0]], 0.5), rules->coco19[kHipJoints[1]], 0.5);
  const PointRule to_left = AddRules(rules->coco19[kHipJoints[0]], rules->coco19[kBodyCenterJoint], -1);
  rules->tails[bones.pelvis] = AddRules(rules->heads[bones.pelvis], to_left, 1);
  EndChain(bones.spine, rules->coco19[0], rules);
  EndChain(bones.neck, rules->heads[bones.head], rules);
}

void PlaceRig(const RigRules& rules, const Eigen::Matrix3Xd& vertices, const Eigen::MatrixXf& displacements,
              BodyTemplate* body) {
  const Eigen::Index num_bones = static_cast<Eigen::Index>(rules.heads.size()), num_shapes = displacements.cols();
  const auto place = [&](const Eigen::Matrix3Xd& points, auto heads, auto tails, auto coco19) {
    for (Eigen::Index b = 0; b < num_bones; ++b) {
      heads.template segment<3>(3 * b) = ApplyRule(rules.heads[b], points);
      tails.template segment<3>(3 * b) = ApplyRule(rules.tails[b], points);
    }
    for (int j = 0; j < 19; ++j) coco19.template segment<3>(3 * j) = ApplyRule(rules.coco19[j], points);
  };
  body->bone_heads.resize(3, num_bones);
  body->bone_tails.resize(3, num_bones);
  body->coco19.resize(3, 19);
  place(vertices, body->bone_heads.reshaped(), body->bone_tails.reshaped(), body->coco19.reshaped());
  BlendShapes& shapes = body->shapes;
  shapes.heads.resize(3 * num_bones, num_shapes);
  shapes.tails.resize(3 * num_bones, num_shapes);
  shapes.coco19.resize(57, num_shapes);
  for (Eigen::Index s = 0; s < num_shapes; ++s) {
    const Eigen::Matrix3Xd moved = displacements.col(s).cast<double>().reshaped(3, vertices.cols());
    place(moved, shapes.heads.col(s), shapes.tails.col(s), shapes.coco19.col(s));
  }
  const RoleBones bones = FindRoleBones(*body);
  body->coco19_bone.fill(bones.head);
  body->coco19_bone[0] = bones.spine.back();
  body->coco19_bone[kBodyCenterJoint] = bones.pelvis;
  for (int side = 0; side < 2; ++side) {
    for (int i = 0; i < 3; ++i) {
      body->coco19_bone[(side == 0 ? 3 : 9) + i] = bones.arms[side][i + 1];
      body->coco19_bone[(side == 0 ? 6 : 12) + i] = bones.legs[side][i];
    }
  }
}

void SetSkin(std::vector<std::vector<std::pair<int, double>>> weights, BodyTemplate* body) {
  const Eigen::Index count = body->vertices.cols();
  MVS_CHECK(static_cast<Eigen::Index>(weights.size()) == count, weights.size() << " skin weights for " << count << " vertices");
  body->skin_bones.setZero(4, count);
  body->skin_weights.setZero(4, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    auto& mine = weights[i];
    std::stable_sort(mine.begin(), mine.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
    if (mine.size() > 4) mine.resize(4);
    double sum = 0;
    for (const auto& [bone, weight] : mine) sum += weight;
    if (!(sum > 0)) mine = {{0, 1.0}}, sum = 1;
    for (size_t k = 0; k < mine.size(); ++k) {
      body->skin_bones(static_cast<int>(k), i) = mine[k].first;
      body->skin_weights(static_cast<int>(k), i) = static_cast<float>(mine[k].second / sum);
    }
  }
}

}  // namespace mvstudio::body
