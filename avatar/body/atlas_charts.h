#pragma once

#include <Eigen/Core>

#include "avatar/body/body_template.h"

/// Cylindrical charts, shared by the atlases of the mannequin and of other templates: internal to the module.
namespace mvstudio::body {

/// Chart coordinates of a region: `angle` around the axis from `front`, `length` along it, going over the ends as an arc.
struct RegionAxis {
  Eigen::Vector3d begin, end, front;  // metres in body; front is a direction
  int front_part, back_part;          // the same when the region is one chart
  double arc_m;                       // radius that turns angles at the ends into lengths

  double Angle(const Eigen::Vector3d& x) const;
  double Length(const Eigen::Vector3d& x) const;
};

/// Corners of face f, one a column.
Eigen::Matrix3d FaceCorners(const BodyTemplate& body, int f);
/// Part and chart coordinates, not yet normalised, of face f in the charts about `axis`: no face spans the seam.
void ChartFace(const RegionAxis& axis, int f, BodyTemplate* body);
/// Scales every chart into [0, 1] x [0, 1]. Charts alike share their range of v, so that patterns go on across their seams.
void NormalizeCharts(BodyTemplate* body);

}  // namespace mvstudio::body
