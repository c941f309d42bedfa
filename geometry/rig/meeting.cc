#include "geometry/rig/meeting.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

namespace mvstudio::geometry {
namespace {

Eigen::Vector3d AxisInWorld(const RigCamera& camera) {
  return camera.cam_from_world.rotation.inverse() * Eigen::Vector3d::UnitZ();
}

template <class Change>
Rig WithPosesChanged(Rig rig, const Change& change) {
  for (RigCamera& camera : rig.cameras) {
    camera.cam_from_world = change(camera.cam_from_world);
    camera.cam_from_world_covariance.reset();
  }
  rig.joint_covariance.reset();
  return rig;
}

}  // namespace

AxesMeeting MeetingOfAxes(const Rig& rig) {
  AxesMeeting meeting;
  const double count = static_cast<double>(rig.cameras.size());
  if (rig.cameras.size() < 2) return meeting;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero(), mean = Eigen::Vector3d::Zero();
  for (const RigCamera& camera : rig.cameras) {
    const Eigen::Vector3d axis = AxisInWorld(camera);
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    normal += across, right += across * camera.CenterInWorld(), mean += camera.CenterInWorld() / count;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(normal / count);
  meeting.determined = solver.eigenvalues()[0] > 1e-4;  // axes that differ by a degree
  if (!meeting.determined) return meeting;
  meeting.x_in_world = normal.ldlt().solve(right);
  for (const RigCamera& camera : rig.cameras) {
    const Eigen::Vector3d to_point = meeting.x_in_world - camera.CenterInWorld(), axis = AxisInWorld(camera);
    meeting.mean_distance_m += to_point.norm() / count;
    meeting.miss_m += (to_point - axis * axis.dot(to_point)).squaredNorm() / count;
    meeting.spread_m += (camera.CenterInWorld() - mean).squaredNorm() / count;
    meeting.in_front += axis.dot(to_point) > 0;
  }
  meeting.miss_m = std::sqrt(meeting.miss_m), meeting.spread_m = std::sqrt(meeting.spread_m);
  return meeting;
}

Rig WithPosesInverted(Rig rig, const Eigen::Matrix3d& world_from_file) {
  Rigid3 turn;
  turn.rotation = Eigen::Quaterniond(world_from_file);
  return WithPosesChanged(std::move(rig),
                          [&](const Rigid3& cam_from_world) { return Inverse(cam_from_world * turn) * Inverse(turn); });
}

Rig WithRotationsTransposed(Rig rig) {
  return WithPosesChanged(std::move(rig), [](const Rigid3& pose) { return Rigid3{pose.rotation.inverse(), pose.translation}; });
}

Rig WithAxesMirrored(Rig rig) {
  const Eigen::Vector3d flip(1, -1, 1);
  return WithPosesChanged(std::move(rig), [&](const Rigid3& pose) {
    Rigid3 mirrored;
    const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
    mirrored.rotation = Eigen::Quaterniond(Eigen::Matrix3d(flip.asDiagonal() * rotation * flip.asDiagonal()));
    mirrored.translation = flip.cwiseProduct(pose.translation);
    return mirrored;
  });
}

Rig WithAxesRotated(Rig rig) {
  Rigid3 half_turn;
  half_turn.rotation = Eigen::Quaterniond(0, 1, 0, 0);  // about x
  return WithPosesChanged(std::move(rig), [&](const Rigid3& cam_from_world) { return half_turn * cam_from_world; });
}

}  // namespace mvstudio::geometry
