#include "geometry/rig/rig.h"

namespace mvstudio::geometry {

int Rig::Find(const std::string& name) const {
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i].camera.name == name) return static_cast<int>(i);
  }
  return -1;
}

std::vector<std::string> CameraNames(const Rig& rig) {
  std::vector<std::string> names;
  for (const RigCamera& camera : rig.cameras) names.push_back(camera.camera.name);
  return names;
}

std::vector<std::string> CameraNames(const std::vector<Camera>& cameras) {
  std::vector<std::string> names;
  for (const Camera& camera : cameras) names.push_back(camera.name);
  return names;
}

bool HasJointCovariance(const Rig& rig) {
  if (!rig.joint_covariance) return false;
  const Eigen::MatrixXd& joint = *rig.joint_covariance;
  Eigen::Index row = 0;
  bool any = false;
  for (const RigCamera& camera : rig.cameras) {
    const Eigen::Index p = camera.camera.params.size();
    if (row + p + 6 > joint.rows() || joint.rows() != joint.cols()) return false;
    const auto same = [&](const auto& own, Eigen::Index begin, Eigen::Index size) {
      any = true;
      return own.rows() == size && own.cols() == size &&
             (joint.block(begin, begin, size, size) - own).norm() <= 1e-9 * own.norm();
    };
    if (camera.params_covariance && !same(*camera.params_covariance, row, p)) return false;
    if (camera.cam_from_world_covariance && !same(*camera.cam_from_world_covariance, row + p, 6)) return false;
    row += p + 6;
  }
  return any && row == joint.rows();
}

}  // namespace mvstudio::geometry
