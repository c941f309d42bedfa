#include <Eigen/Geometry>

#include "avatar/body/body_template.h"
#include "core/check.h"

namespace mvstudio::body {
namespace {

/// World from body of one bone with its stretch and the girth: x_in_world = linear * x_in_body + offset.
struct BoneAffine {
  Eigen::Matrix3d linear;
  Eigen::Vector3d offset;
};

std::vector<BoneAffine> BoneAffines(const BodyTemplate& body, const BodyPose& pose) {
  const size_t count = body.bone_names.size();
  MVS_CHECK(pose.bone_transforms.size() == count && pose.bone_stretch.size() == count,
            "pose of " << pose.bone_transforms.size() << " bones for a body of " << count);
  std::vector<BoneAffine> affines(count);
  for (size_t b = 0; b < count; ++b) {
    const Eigen::Vector3d head = body.bone_heads.col(b);
    const Eigen::Vector3d dir = (body.bone_tails.col(b) - head).normalized();
    const Eigen::Matrix3d scale =
        pose.girth * Eigen::Matrix3d::Identity() + (pose.bone_stretch[b] - pose.girth) * dir * dir.transpose();
    affines[b].linear = pose.bone_transforms[b].rotation.toRotationMatrix() * scale;
    affines[b].offset = pose.bone_transforms[b] * head - affines[b].linear * head;
  }
  return affines;
}

/// Rest vertices, displaced by the pose blend shapes where there are any. (3, V) in body
Eigen::Matrix3Xf RestShape(const BodyTemplate& body, const BodyPose& pose) {
  if (body.pose_directions.size() == 0) return body.vertices;
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const size_t count = body.bone_names.size();
  MVS_CHECK(body.pose_directions.rows() == 3 * body.vertices.cols() &&
                body.pose_directions.cols() == 9 * (static_cast<Eigen::Index>(count) - 1),
            "pose directions of " << body.pose_directions.rows() << " x " << body.pose_directions.cols());
  Eigen::VectorXf turns(body.pose_directions.cols());
  for (size_t b = 1; b < count; ++b) {
    const int parent = body.bone_parents[b];
    Eigen::Quaterniond local = pose.bone_transforms[b].rotation;
    if (parent >= 0) local = pose.bone_transforms[parent].rotation.conjugate() * local;
    const RowMajor turn = local.toRotationMatrix() - Eigen::Matrix3d::Identity();
    turns.segment<9>(9 * static_cast<Eigen::Index>(b - 1)) = turn.reshaped<Eigen::RowMajor>().cast<float>();
  }
  Eigen::Matrix3Xf vertices = body.vertices;
  vertices.reshaped() += body.pose_directions * turns;
  return vertices;
}

Eigen::Matrix3Xf Skin(const BodyTemplate& body, const std::vector<BoneAffine>& affines, const Eigen::Matrix3Xf& rest) {
  Eigen::Matrix3Xf vertices(3, rest.cols());
  for (int i = 0; i < vertices.cols(); ++i) {
    const Eigen::Vector3d x = rest.col(i).cast<double>();
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int k = 0; k < 4; ++k) {
      const BoneAffine& affine = affines[body.skin_bones(k, i)];
      sum += body.skin_weights(k, i) * (affine.linear * x + affine.offset);
    }
    vertices.col(i) = sum.cast<float>();
  }
  return vertices;
}

}  // namespace

BodyPose PoseFromAngles(const BodyTemplate& body, const geometry::Rigid3& world_from_body,
                        const std::vector<Eigen::Quaterniond>& local_rotations) {
  const size_t count = body.bone_names.size();
  MVS_CHECK(local_rotations.size() == count, local_rotations.size() << " rotations for " << count << " bones");
  BodyPose pose;
  pose.bone_stretch.assign(count, 1.0);
  pose.bone_transforms.resize(count);
  for (size_t b = 0; b < count; ++b) {
    const int parent = body.bone_parents[b];
    const Eigen::Vector3d head = body.bone_heads.col(b);
    const geometry::Rigid3 turn{local_rotations[b], head - local_rotations[b] * head};
    pose.bone_transforms[b] = (parent < 0 ? world_from_body : pose.bone_transforms[parent]) * turn;
  }
  return pose;
}

Eigen::Matrix3Xf PosedAboutRoot(const BodyTemplate& body, const BodyPose& pose) {
  const Eigen::Matrix3Xf skinned = Skin(body, BoneAffines(body, pose), RestShape(body, pose));
  const geometry::Rigid3& root = pose.bone_transforms[0];
  const Eigen::Vector3d head = root * body.bone_heads.col(0).eval();
  const Eigen::Matrix3d root_from_world = root.rotation.conjugate().toRotationMatrix();
  return (root_from_world * (skinned.cast<double>().colwise() - head)).cast<float>();
}

Eigen::Matrix3Xf SkinVertices(const BodyTemplate& body, const BodyPose& pose) {
  Eigen::Matrix3Xf rest = RestShape(body, pose);
  if (body.moving_offsets) rest += body.moving_offsets->At(PosedAboutRoot(body, pose));
  return Skin(body, BoneAffines(body, pose), rest);
}

Eigen::Matrix3Xd PosedCoco19(const BodyTemplate& body, const BodyPose& pose) {
  const std::vector<BoneAffine> affines = BoneAffines(body, pose);
  Eigen::Matrix3Xd joints(3, 19);
  for (int j = 0; j < 19; ++j) {
    const BoneAffine& affine = affines[body.coco19_bone[j]];
    joints.col(j) = affine.linear * body.coco19.col(j) + affine.offset;
  }
  return joints;
}

}  // namespace mvstudio::body
