#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "calib/board/observations.h"
#include "calib/points/point_resection.h"
#include "calib/points/scene_points.h"
#include "geometry/rig/rig.h"

/// A calibrated rig moved as a whole to another world. Projections stay as they are.
namespace mvstudio::calib {

struct RigAlignment {
  Status status = Status::kOk;
  std::string message;            ///< one line when the status is not kOk
  geometry::Rig rig;              ///< in the new world, with covariances
  geometry::Rigid3 new_from_old;  ///< x_in_new = scale * R x_in_old + t
  double scale = 1;
  int num_points = 0, num_used = 0;
  double rms_px = std::numeric_limits<double>::quiet_NaN();  ///< of the points used, where they were seen in images
  double rms_m = std::numeric_limits<double>::quiet_NaN();   ///< of the points used, where they are compared in space
  std::vector<std::string> gross;                            ///< points that disagree, with their distance
  std::vector<std::string> unknown;  ///< cameras whose given lens or pose has no covariance, where it matters
};

/// The world of the first board as it lies in frame `frame`, face up (WorldFromFloorBoard). Its pose comes from all corners
/// that the rig's cameras see there, with the shape that the rig states of the board. Covariances become relative to the
/// board: the noise of its corners and the rig's own errors between the cameras. Cameras that the rig lacks are ignored.
/// Throws UsageError when no camera of the rig sees the board in that frame.
RigAlignment AlignToBoard(const geometry::Rig& rig, const CalibrateInput& input, int64_t frame);

/// The world of marked points. Without `with_scale`, the rig is placed by the clicks as a rigid body, and covariances become
/// relative to the points. With it, points that two cameras see are triangulated, and a similarity brings them to their
/// places; covariances stay relative to what fixed the old world (geometry::InWorld).
RigAlignment AlignToClicks(const geometry::Rig& rig, const ScenePoints& points, bool with_scale,
                           const PointResectionOptions& options);

/// The same points in two worlds.
struct PlacePairs {
  std::vector<std::string> names;
  Eigen::Matrix3Xd x_in_old, x_in_new;  ///< (3, N) metres
};

/// True when the table at `path` has columns x_old, y_old, z_old.
bool HasPlacePairs(const std::string& path);
/// True when it has the columns of marks in images: camera, point.
bool HasClicks(const std::string& path);
/// Reads `point,x,y,z,x_old,y_old,z_old`, metres. Throws IoError, FormatError.
PlacePairs ReadPlacePairs(const std::string& path);

/// The least-squares motion, or with `with_scale` similarity, that brings points in the old world to their places in the
/// new one. Refuses fewer than three, collinear ones, and mirrored coordinates. Covariances stay relative to what fixed the
/// old world.
RigAlignment AlignToPlaces(const geometry::Rig& rig, const PlacePairs& pairs, bool with_scale);

}  // namespace mvstudio::calib
