#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/progress.h"
#include "geometry/rig/rig.h"
#include "triangulate/people/association.h"
#include "triangulate/people/sides.h"
#include "triangulate/point/diagnosis.h"
#include "triangulate/point/holdout.h"
#include "triangulate/point/point.h"
#include "triangulate/take/method.h"

namespace mvstudio::triangulate {

struct TakeOptions {
  TakeMethod method;
  bool select_views = false;           ///< choose among the views with any method, as robust and auto always do
  double sigma_px = 0;                 ///< of a detection with score 1; 0: estimated from the take
  double min_score = 0.3;              ///< detections below are left out
  double score_power = 0;              ///< sigma grows as score^-score_power; 0: scores are not noise levels
  double max_residual_sigmas = 4;      ///< see PointOptions
  double min_parallax_sigmas = 5;      ///< see PointOptions
  double max_distance_m = 0;           ///< see PointOptions
  int min_views = 2;                   ///< views that a point needs
  double max_error_px = 15;            ///< exhaustive-dlt only: mean reprojection error accepted
  bool ignore_distortion = false;      ///< treat every lens as a pinhole
  bool fix_sides = true;               ///< swap left and right back where a camera has them exchanged
  bool calibration_covariance = true;  ///< a point's covariance includes the calibration's uncertainty, where the rig states
                                       ///< it
  int max_persons = 1;                 ///< persons kept
  double association_error_px = 0;     ///< see AssociationOptions::max_error_px
  int holdout_points = 2000;           ///< points on which each camera in turn is left out; 0: none
};

template <class Visitor>
void VisitFields(Visitor&& visit, TakeOptions& o) {
  visit("method", o.method,
        "auto: the cheapest that held-out views justify. robust: chooses views, most likely point. all-views, linear, "
        "midpoint, …: trust every detection. exhaustive-dlt: Pose2Sim's");
  visit("select-views", o.select_views, "choose among the views with any method; robust and auto always do");
  visit("sigma-px", o.sigma_px, "px; standard deviation of a detection with score 1; 0 estimates it from the take");
  visit("min-score", o.min_score, "0..1; detections with a lower score are left out");
  visit("score-power", o.score_power, "a detection's sigma is sigma-px / score^power; 0 ignores scores");
  visit("max-residual-sigmas", o.max_residual_sigmas, "a view with a larger residual does not support the point");
  visit("min-parallax-sigmas", o.min_parallax_sigmas, "distance over its own uncertainty below which a point is LowParallax");
  visit("max-distance-m", o.max_distance_m, "m; points farther from every camera are FarPoint; 0: no limit");
  visit("min-views", o.min_views, "views that a point needs, at least 2");
  visit("max-error-px", o.max_error_px, "px; exhaustive-dlt: mean reprojection error that ends the search");
  visit("ignore-distortion", o.ignore_distortion, "take every lens as a pinhole; exhaustive-dlt always does");
  visit("fix-sides", o.fix_sides, "swap left and right back where a camera's detector confused them");
  visit("calibration-covariance", o.calibration_covariance,
        "a point's covariance holds the calibration's own uncertainty, where the calibration carries one");
  visit("max-persons", o.max_persons, "the best supported persons of the take are kept");
  visit("association-error-px", o.association_error_px,
        "px; 3 sigma of a joint is taken to be at most this when people are matched across views; 0: 1.5 % of the diagonal");
  visit("holdout-points", o.holdout_points, "points on which one camera after the other is left out and predicted; 0: none");
}

/// Joints that tell a person from a mirror image; -1: there is none.
struct BodySides {
  int nose = -1, left_shoulder = -1, right_shoulder = -1, left_hip = -1, right_hip = -1;
};

/// Known properties of the bodies in a take.
struct TakeBody {
  // Implicit from a number of joints; left and right are then not checked.
  TakeBody(int joints) : num_joints(joints) {}  // NOLINT(google-explicit-constructor)
  TakeBody(int joints, MirrorGroups groups) : num_joints(joints), mirror(std::move(groups)) {}

  int num_joints = 0;
  MirrorGroups mirror = {};  ///< joints that a detector exchanges when it swaps left and right
  BodySides sides = {};
};

struct TakePoint {
  int frame = 0, person = 0, joint_idx = 0;
  Point point;
};

struct TakeResult {
  std::vector<TakePoint> points;                       ///< every joint of every person in every frame: by frame, person, joint
  std::vector<std::vector<Observation>> observations;  ///< of each point, with its final sigmas
  std::vector<CameraDiagnosis> cameras;                ///< in the rig's order
  TakeMethod method;                                   ///< the method that solved the points; not auto
  MethodChoice choice;                                 ///< how the method auto chose it; no scores for any other
  LeftOutSummary holdout;                              ///< leave-one-camera-out errors of that method
  SideReport sides;                                    ///< detections whose left and right were swapped back
  int num_ghosts = 0;                                  ///< persons made of chance matches, removed
  double solve_s = 0;                                  ///< wall time of solving the points alone
  double sigma_px = 0;                                 ///< given or estimated; 0 for exhaustive-dlt
  int num_persons = 0;
};

/// Triangulates a take. `frames` ascend and hold one list of people per camera of the rig; every person has
/// `body.num_joints` joints. The result does not depend on the number of threads. Throws UsageError for options
/// out of range.
TakeResult TriangulateTake(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body,
                           const TakeOptions& options, const RunContext& run = {});

/// Throws UsageError when an option is out of range for this rig.
void CheckOptions(const geometry::Rig& rig, const TakeOptions& options);

}  // namespace mvstudio::triangulate
