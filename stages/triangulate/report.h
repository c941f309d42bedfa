#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "geometry/rig/rig.h"
#include "geometry/skeleton/skeleton.h"
#include "stages/budget/report.h"
#include "stages/calib/calibration_use.h"
#include "stages/input_notes.h"
#include "stages/people/human_shape.h"
#include "stages/triangulate/filter_check.h"
#include "stages/triangulate/joint_views.h"
#include "stages/triangulate/options.h"
#include "stages/triangulate/point_statistics.h"
#include "stages/triangulate/points_out.h"
#include "stages/triangulate/project_parts.h"
#include "triangulate/skeleton/refine.h"
#include "triangulate/take/cause.h"
#include "triangulate/take/take.h"

namespace mvstudio::stages {

/// What the take's cameras say against its calibration as a whole.
enum class Inconsistency {
  kNone,
  kNoNoiseExplains,    ///< the search for the detections' noise found none
  kNoise,              ///< detections scatter by a considerable part of the image
  kRarelyPredicted,    ///< the other cameras predict few of a camera's detections
  kFarFromPrediction,  ///< and what they predict is far from them
};

/// Which question about causes was asked.
enum class CauseQuestion { kNone, kTiming, kCamera, kScatter, kLoss };

struct TriangulateReport {
  TriangulateOptions options;  ///< as session and project settled them
  InputNotes notes;
  std::optional<ProjectUse> project;
  std::optional<BudgetReport> budget;  ///< where a budget or a target was asked for

  geometry::Rig rig;  ///< as it was read
  geometry::Skeleton skeleton;
  std::vector<std::string> cameras;    ///< that have 2D joints
  std::optional<OffsetUse> offsets;    ///< of a calibration that states some
  triangulate::TakeResult beginning;   ///< of a take of which `take` is a sample: what images are drawn of
  triangulate::TakeResult take;        ///< in chunks: of the sample that stands for the take
  std::optional<FilterCheck> filter;   ///< where marker files are filled or filtered
  bool refined_without_bones = false;  ///< the joints have none whose lengths could be held
  std::optional<triangulate::SkeletonRefineReport> refinement;

  PointFigures points;
  Loss loss;
  LimbJudgement limbs;
  double trunk_tilt_deg = 0;  ///< TrunkTiltDeg
  Inconsistency inconsistency = Inconsistency::kNone;
  CauseQuestion asked = CauseQuestion::kNone;
  triangulate::CauseReport causes;  ///< its answer
  std::vector<ReferenceComparison> comparisons;

  bool kept_older = false;  ///< no point was found, and those of an earlier run stay
  std::optional<JointViewReport> views;
  std::optional<MarkerReport> markers;
  OldMarkers old_markers = OldMarkers::kNone;  ///< made of points that were replaced

  std::string MarkerFolder() const;
  /// Why the sigmas do not hold the calibration's uncertainty; empty: they do, as far as it is known.
  std::string WhyWithoutCovariance() const;
  bool NothingInCommon() const;   ///< a reference has no joint of the take
  double MeanDiagonalPx() const;  ///< of the cameras' images
};

}  // namespace mvstudio::stages
