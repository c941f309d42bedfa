#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/points/point_resection.h"

namespace mvstudio::calib {

/// Marked points of a scene with known coordinates, and their positions in images.
struct ScenePoints {
  std::vector<std::string> names;    ///< of the points
  Eigen::Matrix3Xd x_in_world;       ///< (3, N) metres; NaN for points that were clicked but have no coordinates
  std::vector<std::string> cameras;  ///< in order of appearance
  std::vector<PointClick> clicks;    ///< camera_idx into `cameras`
};

/// Reads `camera,point,x_px,y_px` and `point,x,y,z` (metres; `name` for `point` is the same), from two files in either order or
/// from one file with all these columns. Throws UsageError for another number of files, IoError, FormatError. The latter for a
/// point with two positions, a camera that sees a point twice, a clicked point without a position, or no clicks.
ScenePoints ReadScenePoints(const std::vector<std::string>& paths);

/// Same of tables that need not hold clicks. A table of names alone gives points whose places nobody knows; where one has a
/// place, all that are clicked need one.
ScenePoints ReadScenePlaces(const std::vector<std::string>& paths);

/// Same of tables that hold clicks; their points need no place.
ScenePoints ReadMarks(const std::vector<std::string>& paths);

struct SceneResectionReport {
  geometry::Rig
      rig;  ///< the cameras that could be placed, with covariances (PlacedCovariance); world is the frame of the points
  struct CameraResult {
    std::string name;
    PointResection resection;
    int num_clicks = 0;
    std::vector<std::string> gross;  ///< points that disagree, with their distance: "door: 143 px"
  };
  std::vector<CameraResult> cameras;       ///< in the order of the intrinsics; only those that see a point
  std::vector<std::string> given_unknown;  ///< placed cameras whose given lens, or pose in the group, has no covariance
};

/// Places each camera of `intrinsics` that the clicks name, individually. With `rigid`, the relative poses in `intrinsics`
/// are kept and the whole group is placed; then there is one result, named "rig". Throws UsageError when a clicked camera
/// is not in `intrinsics`.
SceneResectionReport ResectScene(const ScenePoints& points, const geometry::Rig& intrinsics, bool rigid,
                                 const PointResectionOptions& options);

}  // namespace mvstudio::calib
