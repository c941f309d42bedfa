#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "avatar/body/fit/posed_bones.h"
#include "avatar/body/fit/rim.h"
#include "core/status.h"

namespace mvstudio::body {

/// What is expected of the bones' local rotations before anything is seen: residual_b = weight_b * Log(mean_b^-1 * local_b).
struct RotationPrior {
  std::vector<Eigen::Quaterniond> mean;  ///< (B)
  std::vector<Eigen::Matrix3d> weight;   ///< (B) 1 / rad, in axes of the rest pose; zero: nothing is expected
};

/// People's joints in general: hinges at elbows and knees, a trunk that bends as a whole, little twist of limbs. The angles are
/// half of the usual ranges of motion (Kapandji, The Physiology of the Joints), hence one standard deviation; limbs swing
/// freely.
RotationPrior AnatomicalPrior(const BodyTemplate& body);

/// 3D joints of one time step.
struct JointObservation {
  Eigen::Matrix3Xd x_in_world;  ///< (3, 19) metres
  std::array<bool, 19> valid{};
  std::array<double, 19> sigma_m{};  ///< standard deviation of each coordinate
};

/// What an image says about one vertex: direction . (x - at) should be `gap`. For an outline in px, for brightness in its
/// units.
struct SurfaceResidual {
  int vertex = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< units per metre of the vertex in world
  Eigen::Vector3d at = Eigen::Vector3d::Zero();         ///< the vertex in world where `gap` was measured
  double gap = 0;
  double weight = 0;  ///< 1 / units
};

struct PoseProblemInput {
  JointObservation joints;
  std::vector<RotationPrior> priors;
  std::vector<SurfaceResidual> surface;
};

struct PoseSolution {
  Status status = Status::kOk;  ///< kNotConverged: the last of the iterations allowed; kNonFiniteInput; kDegenerate
  ArticulatedPose pose;
  double cost = 0;  ///< half the sum of the robust squared residuals
};

/// Levenberg-Marquardt from `start`; joints by a Cauchy loss at 3 sigma, outlines by one at 3 / weight.
PoseSolution SolvePose(const BodyTemplate& body, const PoseProblemInput& input, const ArticulatedPose& start,
                       int max_iterations);

}  // namespace mvstudio::body
