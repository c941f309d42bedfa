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

/// Who is seen where in a take. What cameras saw of its points, 5 kB for each frame of 4 cameras and 25 joints, is made as it
/// is needed.
class TakePeople {
 public:
  /// Associates the people and estimates the noise; the problem gets all but labels and observations. Keeps a reference to
  /// `frames`. Arguments and errors as in TriangulateTake.
  TakePeople(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body,
             const TakeOptions& options, const RunContext& run, TakeProblem* problem);

  size_t num_frames() const { return assignment_.size(); }
  size_t num_points() const { return first_.back(); }
  /// Labels and observations of the frames [begin, end).
  void Collect(size_t begin, size_t end, TakeProblem* problem) const;
  /// The same of points by their indices in the take.
  void Collect(const std::vector<size_t>& points, TakeProblem* problem) const;
  /// At most `max_points` points with `min_views` or more, evenly spaced.
  std::vector<size_t> Spread(size_t min_views, size_t max_points) const;

 private:
  const std::vector<DetectedFrame>& frames() const { return swapped_.empty() ? *given_ : swapped_; }
  void Append(size_t frame, size_t person, int joint_idx, TakeProblem* problem) const;
  void FindSides(const geometry::Rig& rig, const TakeBody& body, const RunContext& run, TakeProblem* problem);
  void EstimateSigma(const geometry::Rig& rig, int num_threads, TakeProblem* problem) const;

  TakeOptions options_;
  size_t num_joints_ = 0;
  const std::vector<DetectedFrame>* given_ = nullptr;
  std::vector<DetectedFrame> swapped_;                     // the same with left and right put back, where any were exchanged
  std::vector<std::vector<std::vector<int>>> assignment_;  // [frame][person][camera]
  std::vector<size_t> first_;                              // index of each frame's first point, then their number
};

/// The same with all observations.
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

/// Leave-one-camera-out errors on at most about `max_points` points, evenly spaced over those of the problem.
LeftOutSummary HoldOut(const TakeProblem& problem, const PointSolver& solve, int max_points, int num_threads);

}  // namespace mvstudio::triangulate
