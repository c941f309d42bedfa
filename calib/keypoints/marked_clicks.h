// Private: clicks of marks, and the relative poses of two cameras that they allow, for place_marks.cc.
#pragma once

#include <map>
#include <vector>

#include "calib/points/scene_points.h"

namespace mvstudio::calib {

struct MarkObservation {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();  ///< in cam, of length 1
};

struct MarkedClicks {
  geometry::Rig rig;                                         ///< the cameras that were clicked in; poses have no meaning
  std::vector<std::map<int, MarkObservation>> observations;  ///< per camera, by point
  std::vector<double> sigma_rad;                             ///< per camera
  double sigma_px = 1;
};

/// Throws UsageError for a camera that `lenses` lacks.
MarkedClicks ClicksOf(const geometry::Rig& lenses, const ScenePoints& marks, double sigma_px);

/// A relative pose of two cameras with a translation of length 1.
struct RelativeStart {
  size_t a = 0, b = 0;
  geometry::Rigid3 b_from_a;
  double cost = 0, score = 0;  // over the common points; the score is large for many points with a large parallax
};

/// Starts of all pairs of cameras that share six points or more, the most promising first.
std::vector<RelativeStart> RelativeStarts(const MarkedClicks& clicked);

}  // namespace mvstudio::calib
