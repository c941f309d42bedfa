#include "avatar/run/pack/body_shape.h"

#include <Eigen/Geometry>
#include <vector>

#include "core/check.h"

namespace mvstudio::avatar {
namespace {

// Girth of each vertex: the mean over its faces, smoothed along the surface so that neighbouring groups blend.
Eigen::VectorXd VertexGirth(const body::BodyTemplate& body, const BodyShape& shape) {
  const Eigen::Index count = body.vertices.cols();
  Eigen::VectorXd girth = Eigen::VectorXd::Zero(count), faces = Eigen::VectorXd::Zero(count);
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
    for (int k = 0; k < 3; ++k) {
      girth[body.faces(k, f)] += shape.girth[GroupOfPart(body.face_part[f])];
      faces[body.faces(k, f)] += 1;
    }
  }
  girth = (faces.array() > 0).select(girth.array() / faces.array().max(1), 1.0).matrix();
  constexpr int kSmoothing = 6;
  for (int round = 0; round < kSmoothing; ++round) {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(count);
    for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
      const double mean = (girth[body.faces(0, f)] + girth[body.faces(1, f)] + girth[body.faces(2, f)]) / 3;
      for (int k = 0; k < 3; ++k) sum[body.faces(k, f)] += mean;
    }
    girth = (faces.array() > 0).select(sum.array() / faces.array().max(1), girth.array()).matrix();
  }
  return girth;
}

// What points from bone `b` to x, across the bone. Bones of the trunk lie across the body: there the axis is the body's own.
Eigen::Vector3d Across(const body::BodyTemplate& body, int b, GirthGroup group, const Eigen::Vector3d& x) {
  const Eigen::Vector3d head = body.bone_heads.col(b), tail = body.bone_tails.col(b);
  if (group == kHeadGirth) return x - (head + tail) / 2;
  if (group == kTrunkGirth) return {x[0], x[1] - head[1], 0};
  const Eigen::Vector3d direction = (tail - head).normalized();
  return (x - head) - direction * direction.dot(x - head);
}

std::vector<GirthGroup> VertexGroups(const body::BodyTemplate& body) {
  std::vector<GirthGroup> groups(body.vertices.cols(), kTrunkGirth);
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
    for (int k = 0; k < 3; ++k) groups[body.faces(k, f)] = GroupOfPart(body.face_part[f]);
  }
  return groups;
}

}  // namespace

GirthGroup GroupOfPart(int part) {
  MVS_CHECK(part >= 1 && part <= body::kNumParts, "part " << part);
  if (part <= 2) return kTrunkGirth;
  if (part >= 23) return kHeadGirth;
  return part <= 4 || part >= 15 ? kArmGirth : kLegGirth;
}

body::BodyTemplate ScaleGirth(const body::BodyTemplate& body, const BodyShape& shape) {
  for (const double girth : shape.girth) MVS_CHECK(girth > 0.1 && girth < 10, "girth " << girth);
  const Eigen::VectorXd girth = VertexGirth(body, shape);
  const std::vector<GirthGroup> groups = VertexGroups(body);
  body::BodyTemplate scaled = body;
  for (Eigen::Index i = 0; i < body.vertices.cols(); ++i) {
    const Eigen::Vector3d x = body.vertices.col(i).cast<double>();
    Eigen::Vector3d across = Eigen::Vector3d::Zero();
    for (int k = 0; k < 4; ++k) across += body.skin_weights(k, i) * Across(body, body.skin_bones(k, i), groups[i], x);
    scaled.vertices.col(i) = (x + (girth[i] - 1) * across).cast<float>();
  }
  return scaled;
}

}  // namespace mvstudio::avatar
