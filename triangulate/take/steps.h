#pragma once

#include <string>
#include <vector>

#include "triangulate/take/take.h"

/// TriangulateTake in steps, for those who compare methods on the same points.
namespace mvstudio::triangulate {

/// Everything that is to be triangulated: who is who, what the cameras saw of each joint, and how well they see.
struct TakeProblem {
  PreparedRig rig;
  std::vector<PointLabel> labels;                      ///< every joint of every person in every frame
  std::vector<std::vector<Observation>> observations;  ///< of each, with their sigmas
  double sigma_px = 0;  ///< of a detection with score 1, given or estimated; 0 for exhaustive-dlt
  int num_persons = 0, num_ghosts = 0;
  SideReport sides;
};

/// Associates the people and estimates the noise. Arguments and errors as TriangulateTake.
TakeProblem PrepareTake(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body,
                        const TakeOptions& options, const RunContext& run);

/// How one point is solved by a method's name (TakeOptions::method, but not "auto"). Keeps references to both arguments.
PointSolver SolverFor(const geometry::Rig& rig, const TakeProblem& problem, const TakeOptions& options,
                      const std::string& method);

/// At most `max_views` of the observations, in their order: those whose cameras stand farthest from each other, one after the
/// other.
std::vector<Observation> FewerViews(const PreparedRig& rig, const std::vector<Observation>& observations, int max_views);

/// All points, by label. The result does not depend on the number of threads.
std::vector<Point> SolvePoints(const TakeProblem& problem, const PointSolver& solve, int num_threads);

/// One camera left out, on at most about `max_points` points evenly spread over the take.
LeftOutSummary HoldOut(const TakeProblem& problem, const PointSolver& solve, int max_points, int num_threads);

/// The names that `method` knows, in one line.
std::string MethodNames();

}  // namespace mvstudio::triangulate
