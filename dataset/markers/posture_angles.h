// Private: for angles and gait events, of one moment.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "dataset/markers/joint_angles.h"

namespace mvstudio::markers::internal {

/// The joints that angles are made of.
enum Role {
  kLHip,
  kRHip,
  kLKnee,
  kRKnee,
  kLAnkle,
  kRAnkle,
  kLHeel,
  kRHeel,
  kLToe,
  kRToe,
  kLSmallToe,
  kRSmallToe,
  kLShoulder,
  kRShoulder,
  kLElbow,
  kRElbow,
  kLWrist,
  kRWrist,
  kNeck,
  kHead,
  kLEar,
  kREar,
  kMidHip,
  kNumRoles,
};

/// The marker of each role; -1: there is none.
std::vector<int> RolesOf(const std::vector<std::string>& names);

/// Positions with y up (dataset::AxesFromWorld), NaN where missing; values in radians, not made continuous.
struct RawAngles {
  std::vector<double> rad;
  std::vector<AngleStatus> status;
};
RawAngles ComputeAngles(const std::vector<Eigen::Vector3d>& roles, bool has_up);

/// Places in AngleDefinitions(): of the trunk, then of the right and of the left side.
enum TrunkAngle {
  kHeading,
  kObliquity,
  kTilt,
  kList,
  kRotation,
  kTrunkFlexion,
  kTrunkBending,
  kLumbarBending,
  kLumbarRotation,
  kNeckFlexion,
  kNeckBending,
  kNeckRotation,
  kNumTrunk,
};
enum SideAngle {
  kHipFlexion,
  kHipAdduction,
  kHipRotation,
  kKneeFlexion,
  kAnkle,
  kPlane,
  kElevation,
  kShoulderRotation,
  kArmFlex,
  kArmAdd,
  kArmRot,
  kElbow,
  kNumSide,
};

}  // namespace mvstudio::markers::internal
