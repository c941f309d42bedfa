#pragma once

#include <vector>

#include "triangulate/take/take.h"

/// TriangulateTake in steps, to compare methods on the same points.
namespace mvstudio::triangulate {

/// Input of the triangulation: identities, the observations of each joint, and their accuracy.
struct TakeProblem {
  PreparedRig rig;
  std::vector<PointLabel> labels;                      ///< every joint of every person in every frame
  std::vector<std::vector<Observation>> observations;  ///< of each label, with their sigmas
  double sigma_px = 0;  ///< of a detection with score 1, given or estimated; 0 for exhaustive-dlt
  int num_persons = 0, num_ghosts = 0;
  SideReport sides;
};

/// Associates the people and estimates the noise. Arguments and errors as in TriangulateTake.
TakeProblem PrepareTake(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body,
                        const TakeOptions& options, const RunContext& run);

/// The solver of a method; auto counts as robust. Keeps references to `rig` and `problem`.
PointSolver SolverFor(const geometry::Rig& rig, const TakeProblem& problem, const TakeOptions& options,
                      const TakeMethod& method);

/// At most `max_views` of the observations, in their order, chosen one after the other so that the cameras are farthest
/// apart.
std::vector<Observation> FewerViews(const PreparedRig& rig, const std::vector<Observation>& observations, int max_views);

/// All points, one per label. The result does not depend on the number of threads.
std::vector<Point> SolvePoints(const TakeProblem& problem, const PointSolver& solve, int num_threads);

/// Leave-one-camera-out errors on at most about `max_points` points, evenly spaced over the take.
LeftOutSummary HoldOut(const TakeProblem& problem, const PointSolver& solve, int max_points, int num_threads);

}  // namespace mvstudio::triangulate
