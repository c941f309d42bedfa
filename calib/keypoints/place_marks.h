#pragma once

#include <string>
#include <vector>

#include "calib/points/scene_points.h"
#include "calib/points/stated_length.h"

namespace mvstudio::calib {

/// Cameras of known lenses that marks of unknown place put into one rig.
struct MarkedRig {
  Status status = Status::kOk;  ///< kTooFewViews, kDegenerate, kNotConverged: `message` says which camera and why
  std::string message;
  geometry::Rig rig;                      ///< in the axes of its first camera, in an arbitrary unit; with covariances
  NamedPoints points;                     ///< in that frame and unit
  std::vector<std::string> gross;         ///< clicks that disagree, with their distance: "door in left: 143 px"
  std::vector<int> num_clicks, num_used;  ///< per camera
  double rms_px = 0;                      ///< 2-D point RMS over the clicks that were kept
};

/// Poses from clicks alone. Five points of two cameras (Nister, PAMI 2004) give starts, which all points judge; the other
/// cameras follow by the points that those before them triangulate (ResectFromPoints); then all cameras and points are adjusted
/// together and clicks 4.5 standard deviations off are left out. Two arrangements that fit alike are refused: marks in one
/// plane have them. `lenses` must hold the cameras that the clicks name; the rig has those, in its order.
MarkedRig PlaceFromMarks(const geometry::Rig& lenses, const ScenePoints& marks, double click_sigma_px);

}  // namespace mvstudio::calib
