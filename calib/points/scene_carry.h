#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/points/point_resection.h"
#include "geometry/rig/rig_covariance.h"

namespace mvstudio::calib {

/// Covariance of cameras that were placed by marked points, individually or as a rigid group. Includes the clicks' noise
/// and the effect of errors of the given lenses (and of the given poses inside a group). Unknown blocks of the given rig
/// add nothing.
class PlacedCovariance {
 public:
  /// If `rigid`, the poses of `given` are those of a group; else each camera is placed individually and its given pose is
  /// not used.
  PlacedCovariance(const geometry::Rig& given, bool rigid);

  /// Appends the cameras `indices` of the given rig, placed by `resection` in this order.
  void Add(const std::vector<size_t>& indices, const PointResection& resection);

  /// Covariance of all cameras added, in their order. A pose is known where the clicks placed it; a lens where the given
  /// one was known.
  geometry::StatedCovariance Joint() const;

  /// Names of the cameras added whose given lens, or given pose in a group, has no covariance.
  const std::vector<std::string>& unknown() const { return unknown_; }

 private:
  geometry::Rig given_;
  bool rigid_;
  geometry::StatedCovariance stated_;
  std::vector<Eigen::Index> begin_ = {0};  // (cameras + 1) rows of the result
  std::vector<bool> lens_known_;
  std::vector<std::string> unknown_;
  Eigen::MatrixXd by_given_;  // (rows, N)
  Eigen::MatrixXd own_;       // (rows, rows)
};

}  // namespace mvstudio::calib
