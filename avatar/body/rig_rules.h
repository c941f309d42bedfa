#pragma once

#include <Eigen/Core>
#include <array>
#include <utility>
#include <vector>

#include "avatar/body/body_template.h"

/// Where the bones and joints of a template lie relative to its vertices: for readers of templates.
namespace mvstudio::body {

/// A point as a weighted sum of vertices: (vertex, weight).
using PointRule = std::vector<std::pair<int, double>>;

PointRule MeanRule(const std::vector<int>& vertices);
/// a + weight * b.
PointRule AddRules(PointRule a, const PointRule& b, double weight);
Eigen::Vector3d ApplyRule(const PointRule& rule, const Eigen::Matrix3Xd& points);

struct RigRules {
  std::vector<PointRule> heads, tails;  // (B)
  std::array<PointRule, 19> coco19;
};

/// Tails of the bones with a role, as `PoseFromJoints` wants them: spine, neck and limbs end where the next bone begins, the
/// spine at the Panoptic neck, the pelvis' tail lies across, towards the left hip. And the joints that are heads of bones:
/// shoulders to wrists, hips to ankles, BodyCenter between the hips. Those of the face and the Neck are given, and the bones'
/// roles.
void CompleteRules(const BodyTemplate& body, RigRules* rules);

/// Places bones and joints: those of the template from `vertices`, and their displacements by each shape. All (3, N), N the
/// vertices that the rules index; `displacements` has them one shape a column (3N, S).
void PlaceRig(const RigRules& rules, const Eigen::Matrix3Xd& vertices, const Eigen::MatrixXf& displacements,
              BodyTemplate* body);

/// Skin from any number of (bone, weight) a vertex: the four largest, made to sum to one; bone 0 where there is none. (V)
void SetSkin(std::vector<std::vector<std::pair<int, double>>> weights, BodyTemplate* body);

}  // namespace mvstudio::body
