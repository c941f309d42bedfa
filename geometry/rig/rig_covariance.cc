#include "geometry/rig/rig_covariance.h"

#include <algorithm>

#include "core/check.h"
#include "geometry/rigid/cross_matrix.h"

namespace mvstudio::geometry {
namespace {

bool KnowsLens(const RigCamera& camera) {
  const Eigen::Index p = camera.camera.params.size();
  return camera.params_covariance && camera.params_covariance->rows() == p && camera.params_covariance->cols() == p;
}

/// Rows and columns of one block to zero.
void Forget(Eigen::Index first, Eigen::Index count, Eigen::MatrixXd* joint) {
  joint->middleRows(first, count).setZero();
  joint->middleCols(first, count).setZero();
}

}  // namespace

bool StatedCovariance::AnyKnown() const {
  const auto any = [](const std::vector<bool>& flags) { return std::find(flags.begin(), flags.end(), true) != flags.end(); };
  return any(lens_known) || any(pose_known);
}

StatedCovariance StatedCovarianceOf(const Rig& rig) {
  StatedCovariance stated;
  stated.begin = {0};
  for (const RigCamera& camera : rig.cameras) {
    stated.begin.push_back(stated.begin.back() + camera.camera.params.size() + 6);
    stated.lens_known.push_back(KnowsLens(camera));
    stated.pose_known.push_back(camera.cam_from_world_covariance.has_value());
  }
  stated.correlated = HasJointCovariance(rig);
  if (stated.correlated) stated.joint = *rig.joint_covariance;
  if (!stated.correlated) stated.joint = Eigen::MatrixXd::Zero(stated.begin.back(), stated.begin.back());
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const Eigen::Index lens = stated.begin[c], pose = stated.PoseRow(c);
    if (!stated.lens_known[c]) Forget(lens, pose - lens, &stated.joint);
    if (!stated.pose_known[c]) Forget(pose, 6, &stated.joint);
    if (stated.correlated) continue;
    if (stated.lens_known[c]) stated.joint.block(lens, lens, pose - lens, pose - lens) = *rig.cameras[c].params_covariance;
    if (stated.pose_known[c]) stated.joint.block<6, 6>(pose, pose) = *rig.cameras[c].cam_from_world_covariance;
  }
  return stated;
}

void StoreCovariance(const StatedCovariance& stated, Rig* rig) {
  MVS_CHECK(stated.begin.size() == rig->cameras.size() + 1, "covariance of another rig");
  const Eigen::MatrixXd joint = 0.5 * (stated.joint + stated.joint.transpose());
  for (size_t c = 0; c < rig->cameras.size(); ++c) {
    RigCamera& camera = rig->cameras[c];
    const Eigen::Index lens = stated.begin[c], pose = stated.PoseRow(c);
    camera.params_covariance.reset(), camera.cam_from_world_covariance.reset();
    if (stated.lens_known[c]) camera.params_covariance = joint.block(lens, lens, pose - lens, pose - lens);
    if (stated.pose_known[c]) camera.cam_from_world_covariance = joint.block<6, 6>(pose, pose);
  }
  rig->joint_covariance.reset();
  if (stated.correlated && stated.AnyKnown()) rig->joint_covariance = joint;
}

std::vector<std::string> CamerasWithoutCovariance(const Rig& rig) {
  std::vector<std::string> names;
  for (const RigCamera& camera : rig.cameras) {
    if (!KnowsLens(camera) || !camera.cam_from_world_covariance) names.push_back(camera.camera.name);
  }
  return names;
}

Rig SubsetOf(const Rig& rig, const std::vector<size_t>& indices) {
  const StatedCovariance from = StatedCovarianceOf(rig);
  Rig subset = rig;
  subset.cameras.clear(), subset.joint_covariance.reset();
  std::vector<Eigen::Index> rows;
  for (const size_t c : indices) {
    subset.cameras.push_back(rig.cameras.at(c));
    for (Eigen::Index row = from.begin[c]; row < from.begin[c + 1]; ++row) rows.push_back(row);
  }
  if (from.correlated) subset.joint_covariance = Eigen::MatrixXd(from.joint(rows, rows));
  return subset;
}

std::optional<Eigen::MatrixXd> ReorderedJointCovariance(const Rig& rig, const std::vector<int>& order) {
  if (!HasJointCovariance(rig)) return std::nullopt;
  MVS_CHECK(order.size() == rig.cameras.size(), "order of " << order.size() << " cameras");
  const StatedCovariance from = StatedCovarianceOf(rig);
  std::vector<size_t> camera_at(order.size());
  for (size_t i = 0; i < order.size(); ++i) camera_at[static_cast<size_t>(order[i])] = i;
  std::vector<Eigen::Index> rows;
  for (const size_t c : camera_at) {
    for (Eigen::Index row = from.begin[c]; row < from.begin[c + 1]; ++row) rows.push_back(row);
  }
  return Eigen::MatrixXd(from.joint(rows, rows));
}

Rig InWorld(const Rig& rig, const Rigid3& new_from_world, double scale) {
  MVS_CHECK(scale > 0, "a scale of " << scale);
  StatedCovariance stated = StatedCovarianceOf(rig);
  Rig moved = rig;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    Rigid3& pose = moved.cameras[c].cam_from_world;
    pose.rotation = (pose.rotation * new_from_world.rotation.conjugate()).normalized();
    const Eigen::Vector3d arm = pose.rotation * new_from_world.translation;
    pose.translation = scale * pose.translation - arm;
    const Eigen::Matrix3d turn = CrossMatrix(arm);  // of the new translation by the camera's rotation
    const Eigen::Index row = stated.PoseRow(c);
    stated.joint.middleRows<3>(row + 3) = scale * stated.joint.middleRows<3>(row + 3) + turn * stated.joint.middleRows<3>(row);
    stated.joint.middleCols<3>(row + 3) =
        scale * stated.joint.middleCols<3>(row + 3) + stated.joint.middleCols<3>(row) * turn.transpose();
  }
  for (RigBoard& board : moved.boards) board.bend_m *= scale;
  StoreCovariance(stated, &moved);
  return moved;
}

Rig MovedWorld(const Rig& rig, const Eigen::Vector3d& offset) {
  return InWorld(rig, {Eigen::Quaterniond::Identity(), -offset});
}

}  // namespace mvstudio::geometry
