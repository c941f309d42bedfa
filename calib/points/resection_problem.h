// Private: the state of ResectFromPoints, for point_resection*.cc.
#pragma once

#include <vector>

#include "calib/points/point_resection.h"

namespace mvstudio::calib {

/// State of a fit.
struct ResectionProblem {
  std::vector<PointClick> clicks;
  Eigen::Matrix3Xd x_in_world;
  std::vector<geometry::Rigid3> cam_from_rig;
  std::vector<geometry::Camera> cameras;
  std::vector<Eigen::MatrixXd> directions;  ///< per camera, see PointBundleOptions; all empty unless the lens is refined
  geometry::Rigid3 rig_from_world;
};

/// Projected minus clicked, (2, clicks) px; infinite where a point does not project.
Eigen::Matrix2Xd ResectionResiduals(const ResectionProblem& problem);

/// Sets rig_from_world to the best minimal solution from triples of clicks: the one with the least error at the click just
/// past the median. That error goes to `middle_px`. False when there is none.
bool FindResectionStart(ResectionProblem* problem, double* middle_px);

}  // namespace mvstudio::calib
