#include "geometry/rig.h"

namespace mvstudio::geometry {

int Rig::Find(const std::string& name) const {
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i].camera.name == name) return static_cast<int>(i);
  }
  return -1;
}

bool HasJointCovariance(const Rig& rig) {
  if (!rig.joint_covariance) return false;
  const Eigen::MatrixXd& joint = *rig.joint_covariance;
  Eigen::Index row = 0;
  for (const RigCamera& camera : rig.cameras) {
    const Eigen::Index p = camera.camera.params.size();
    if (!camera.params_covariance || !camera.cam_from_world_covariance || row + p + 6 > joint.rows()) return false;
    const auto same = [&](const auto& own, Eigen::Index begin) {
      return own.rows() == own.cols() &&
             (joint.block(begin, begin, own.rows(), own.cols()) - own).norm() <= 1e-9 * own.norm();
    };
    if (camera.params_covariance->rows() != p || !same(*camera.params_covariance, row)) return false;
    if (!same(*camera.cam_from_world_covariance, row + p)) return false;
    row += p + 6;
  }
  return row == joint.rows() && row == joint.cols();
}

}  // namespace mvstudio::geometry
