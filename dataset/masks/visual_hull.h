#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <vector>

#include "core/image.h"
#include "core/status.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig.h"

/// Visual hull of the silhouettes of one time step: the largest body that they all allow (Laurentini, PAMI 1994). Carved
/// coarse to fine from one cube (Szeliski, CVGIP 1993), so that its cost grows with the body's surface. A cell that a
/// single camera excludes is kept with that camera's number: it shows what the others would allow, and hence which camera
/// is wrong.
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
  visit("hull-most-cells", o.most_cells, "maximum number of cells; larger cells are used where more would be needed");
  visit("hull-most-outside", o.most_outside, "share of masks outside the visual hull above which a camera is named");
}

/// A camera and its mask; the sizes must be equal.
struct HullView {
  const geometry::RigCamera* camera = nullptr;
  const Image* mask = nullptr;  // (H, W, 1) 0 or 255
};

/// Search region for people: a cube, metres, in world.
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

/// Agreement of one camera's mask with the others.
struct HullAgreement {
  double mask_px = 0;
  double outside = 0;  ///< fraction of its mask that the hull does not explain
  double missing = 0;  ///< fraction of the projected hull of the other cameras that its mask lacks
  double blame = 0;    ///< mean decrease of the others' `outside` when this camera does not carve
};

struct VisualHull {
  Status status = Status::kOk;  ///< kTooFewViews: fewer than two masks that are not empty; kDegenerate: no point that all
                                ///< allow; kNonFiniteInput: no box
  double voxel_m = 0;           ///< of the finest cells; larger than requested when `most_cells` was reached
  double volume_m3 = 0;         ///< of the cells that no camera excludes
  std::vector<HullCell> cells;  ///< excluded by no camera or by one
  std::vector<HullAgreement> cameras;  ///< in the views' order; all zero unless status is kOk or kDegenerate
};

/// Carves the hull. Empty masks do not carve; nor does a camera that does not see a cell. Throws ContractViolation when a
/// mask's size differs from its camera's.
VisualHull CarveHull(const std::vector<HullView>& views, const HullBox& box, const HullOptions& options = {});

/// 255 where the mask of this camera may be without contradicting two others, enlarged by `margin_px`.
Image PossiblePixels(const VisualHull& hull, const geometry::RigCamera& camera, double margin_px);

/// Agreement over many time steps: accumulate with `Add`, then read the means.
struct HullSummary {
  std::vector<HullAgreement> sums;
  int time_steps = 0, skipped = 0;  ///< skipped: the hull had a status other than kOk and kDegenerate
  void Add(const VisualHull& hull);
  HullAgreement Mean(size_t camera) const;
  /// Cameras whose masks disagree with the others by more than `most_outside`: too large (outside) or too small (blame).
  std::vector<size_t> Disagreeing(double most_outside) const;
  /// Mean over the cameras of outside + missing: smaller is better.
  double Disagreement() const;
};

}  // namespace mvstudio::dataset
