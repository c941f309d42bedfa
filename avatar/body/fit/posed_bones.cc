#include "avatar/body/fit/posed_bones.h"

#include "core/check.h"

namespace mvstudio::body {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

ArticulatedPose FromBodyPose(const BodyTemplate& body, const BodyPose& pose) {
  ArticulatedPose out;
  const Vector3d root = body.bone_heads.col(0);
  out.shift = pose.bone_transforms[0] * root - root;
  for (size_t b = 0; b < pose.bone_transforms.size(); ++b) {
    const int parent = body.bone_parents[b];
    const Quaterniond rotation = pose.bone_transforms[b].rotation;
    out.local_rotations.push_back(parent < 0 ? rotation : pose.bone_transforms[parent].rotation.conjugate() * rotation);
  }
  return out;
}

ArticulatedPose Retract(const BodyTemplate& body, const ArticulatedPose& pose, const PoseStep& step) {
  const size_t count = body.bone_names.size();
  MVS_CHECK(step.size() == static_cast<Eigen::Index>(3 * count + 3),
            "a step of " << step.size() << " for " << count << " bones");
  ArticulatedPose next = pose;
  next.shift += step.tail<3>();
  std::vector<Quaterniond> world(count);
  for (size_t b = 0; b < count; ++b) {
    const int parent = body.bone_parents[b];
    const Quaterniond from = parent < 0 ? Quaterniond::Identity() : world[parent];
    world[b] = from * pose.local_rotations[b];
    const Quaterniond turn = geometry::RotationExp(from.conjugate() * step.segment<3>(3 * static_cast<Eigen::Index>(b)));
    next.local_rotations[b] = (turn * pose.local_rotations[b]).normalized();
  }
  return next;
}

PosedBones::PosedBones(const BodyTemplate& body, const ArticulatedPose& pose) : body_(body), pose_(ToBodyPose(body, pose)) {
  heads_.resize(3, body.bone_heads.cols());
  for (Eigen::Index b = 0; b < heads_.cols(); ++b) {
    heads_.col(b) = pose_.bone_transforms[b] * Vector3d(body.bone_heads.col(b));
    rotations_.push_back(pose_.bone_transforms[b].rotation.toRotationMatrix());
  }
}

Matrix3d PosedBones::ParentRotation(int b) const {
  const int parent = body_.bone_parents[b];
  return parent < 0 ? Matrix3d::Identity() : rotations_[parent];
}

Vector3d PosedBones::Vertex(int v) const {
  const Vector3d x = body_.vertices.col(v).cast<double>();
  Vector3d sum = Vector3d::Zero();
  for (int k = 0; k < 4; ++k) {
    const int b = body_.skin_bones(k, v);
    sum += body_.skin_weights(k, v) * (rotations_[b] * x + pose_.bone_transforms[b].translation);
  }
  return sum;
}

Matrix3d PosedBones::VertexRotation(int v) const {
  Matrix3d sum = Matrix3d::Zero();
  for (int k = 0; k < 4; ++k) sum += body_.skin_weights(k, v) * rotations_[body_.skin_bones(k, v)];
  return sum;
}

void PosedBones::AddDerivative(int b, const Vector3d& x_in_world, const Vector3d& direction, double weight,
                               Eigen::VectorXd* gradient) const {
  for (int a = b; a >= 0; a = body_.bone_parents[a]) {
    gradient->segment<3>(3 * a) += weight * (x_in_world - heads_.col(a)).cross(direction);
  }
  gradient->tail<3>() += weight * direction;
}

Eigen::VectorXd PosedBones::VertexDerivative(int v, const Vector3d& direction) const {
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(3 * heads_.cols() + 3);
  const Vector3d x = body_.vertices.col(v).cast<double>();
  for (int k = 0; k < 4; ++k) {
    const double weight = body_.skin_weights(k, v);
    const int b = body_.skin_bones(k, v);
    if (weight > 0) AddDerivative(b, rotations_[b] * x + pose_.bone_transforms[b].translation, direction, weight, &gradient);
  }
  return gradient;
}

}  // namespace mvstudio::body
