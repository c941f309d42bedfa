#pragma once

#include <Eigen/Core>
#include <vector>

#include "avatar/body/surface_nets.h"

/// The mannequin's shape as an implicit function: internal to the module.
namespace mvstudio::body {

/// Pieces of the body that share a bone chain; left before right.
enum Region {
  kTorso,
  kHead,
  kUpperArmL,
  kForearmL,
  kHandL,
  kUpperArmR,
  kForearmR,
  kHandR,
  kThighL,
  kShinL,
  kFootL,
  kThighR,
  kShinR,
  kFootR
};
inline constexpr int kNumRegions = 14;

/// Rest positions of the mannequin's joints, metres, for a height of 1.75 m; the left side, x > 0.
struct MannequinJoints {
  Eigen::Vector3d body_center{0, 0, 0.93}, spine{0, 0, 1.03}, chest{0, 0, 1.20}, neck{0, 0, 1.43}, head{0, 0, 1.53},
      crown{0, 0, 1.75};
  Eigen::Vector3d nose{0, -0.104, 1.597}, eye{0.031, -0.079, 1.637}, ear{0.072, 0.004, 1.612};
  Eigen::Vector3d clavicle{0.03, 0, 1.41}, shoulder{0.172, 0.01, 1.395}, elbow{0.377, 0.012, 1.190},
      wrist{0.556, -0.022, 1.012};
  Eigen::Vector3d hand_tip{0.676, -0.044, 0.886};
  Eigen::Vector3d hip{0.095, 0, 0.93}, knee{0.105, -0.008, 0.50}, ankle{0.112, 0.018, 0.085}, toe_tip{0.125, -0.170, 0.030};
};

/// A generalised cylinder: elliptic sections around an axis, ellipsoidal caps.
struct Tube {
  struct Section {
    double t;       // along the axis, 0..1
    double rx, ry;  // half axes, metres
    double shift;   // of the centre along y_dir, metres
  };
  Region region;
  Eigen::Vector3d begin, end;
  Eigen::Vector3d x_dir;  // direction of rx, made orthogonal to the axis
  std::vector<Section> sections;
  double cap_begin, cap_end;  // metres

  /// Approximate signed distance, metres, negative inside.
  double Value(const Eigen::Vector3d& x) const;
};

std::vector<Tube> MannequinTubes();
/// Smooth minimum of the tubes of one region, or of all when `region` is negative.
double ShapeValue(const std::vector<Tube>& tubes, int region, const Eigen::Vector3d& x);
/// Closed mesh of all tubes at a grid step of `step_m`, for a height of 1.75 m.
TriangleMesh MeshTubes(const std::vector<Tube>& tubes, double step_m);

}  // namespace mvstudio::body
