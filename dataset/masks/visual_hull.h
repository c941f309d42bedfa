#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <vector>

#include "core/image.h"
#include "core/status.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig.h"

/// What the silhouettes of one instant say together: the visual hull, the largest body that they all allow (Laurentini, PAMI
/// 1994). Carved coarse to fine from one cube (Szeliski, CVGIP 1993), so that its cost grows with the body's surface. A cell
/// that a single camera forbids is kept with that camera's number: it tells what the others would allow and hence who is wrong.
namespace mvstudio::dataset {

struct HullOptions {
  double voxel_m = 0.01;
  double tolerance_px = 2.0;
  int most_cells = 3000000;
  double most_outside = 0.05;
};

template <class Visitor>
void VisitFields(Visitor&& visit, HullOptions& o) {
  visit("hull-voxel", o.voxel_m, "metres; finest cells of the visual hull that masks are compared with");
  visit("hull-tolerance", o.tolerance_px, "px along the outline that do not count as disagreement with the visual hull");
  visit("hull-most-cells", o.most_cells, "cells at most; larger ones are used when these would not do");
  visit("hull-most-outside", o.most_outside, "share of masks outside the visual hull above which a camera is named");
}

/// A camera and its mask; the sizes must be equal.
struct HullView {
  const geometry::RigCamera* camera = nullptr;
  const Image* mask = nullptr;  // (H, W, 1) 0 or 255
};

/// Where to look for people: a cube, metres, in world.
struct HullBox {
  Status status = Status::kOk;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double half_m = 0;
};
/// Around finite joints, with a margin for flesh and clothes. kTooFewViews without any.
HullBox BoxOfJoints(const std::map<int, Coco19Pose>& people, double margin_m = 0.35);
/// Around the point nearest to the rays through the masks' centres. kTooFewViews for fewer than two masks that are not empty,
/// kLowParallax when the rays are parallel, kBehindCamera when they meet behind a camera.
HullBox BoxOfMasks(const std::vector<HullView>& views);

struct HullCell {
  Eigen::Vector3f centre;  ///< metres, in world
  float half_m = 0;
  int16_t forbidden_by = -1;  ///< the one camera whose mask it misses; -1: none
};

/// How one camera's mask agrees with the others.
struct HullAgreement {
  double mask_px = 0;
  double outside = 0;  ///< share of its mask where the hull has nothing to show
  double missing = 0;  ///< share of what the other cameras' hull shows in it that its mask lacks
  double blame = 0;    ///< by how much `outside` of the others falls on average when this camera does not carve
};

struct VisualHull {
  Status status = Status::kOk;  ///< kTooFewViews: fewer than two masks that are not empty; kDegenerate: no point that all
                                ///< allow; kNonFiniteInput: no box
  double voxel_m = 0;                  ///< of the finest cells, larger than asked for when `most_cells` was reached
  double volume_m3 = 0;                ///< of the cells that nobody forbids
  std::vector<HullCell> cells;         ///< forbidden by nobody or by one camera
  std::vector<HullAgreement> cameras;  ///< in the views' order; all zero unless status is kOk or kDegenerate
};

/// Empty masks do not carve; a camera that does not see a cell neither. Throws ContractViolation when a mask's size is not its
/// camera's.
VisualHull CarveHull(const std::vector<HullView>& views, const HullBox& box, const HullOptions& options = {});

/// 255 where a mask of view `view` may be without contradicting two others, widened by `margin_px`.
Image PossiblePixels(const VisualHull& hull, const geometry::RigCamera& camera, double margin_px);

/// Agreement over many instants; add up with `Add`, then read the means.
struct HullSummary {
  std::vector<HullAgreement> sums;
  int instants = 0, skipped = 0;  ///< skipped: the hull had another status than kOk and kDegenerate
  void Add(const VisualHull& hull);
  HullAgreement Mean(size_t camera) const;
  /// Cameras whose masks disagree with the others by more than `most_outside`: too large (outside) or too small (blame).
  std::vector<size_t> Disagreeing(double most_outside) const;
  /// Mean over the cameras of outside + missing: smaller is better.
  double Disagreement() const;
};

}  // namespace mvstudio::dataset
