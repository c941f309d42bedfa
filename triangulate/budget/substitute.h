// Private: for the error budget and its reliability.
#pragma once

#include <cstdint>
#include <unordered_map>

#include "core/random.h"
#include "triangulate/budget/budget.h"
#include "triangulate/take/steps.h"

namespace mvstudio::triangulate::internal {

/// Cameras in which each stage is replaced by the truth.  // [stage][camera]
using Truths = std::array<std::vector<bool>, kNumBudgetStages>;

/// Distances by what they are of: time step, person and joint, of px also the camera.
struct BudgetErrors {
  std::unordered_map<int64_t, double> mm, px;
};

/// Offsets count from the take's own reference and the truth's may be another: moves them about the median difference.
void CentreClocks(const BudgetTruth& truth, std::vector<Clock>* clocks);

/// A take solved with the truth in place of some of its stages.
class Substitution {
 public:
  /// Keeps references.
  Substitution(const BudgetTake& take, const BudgetTruth& truth, const RunContext& run);

  BudgetErrors Solve(const Truths& truths) const;
  Truths Sets(size_t set) const;  ///< the stages whose bits are set, in all cameras

  size_t num_steps() const { return steps_.size(); }
  size_t num_joints() const { return num_joints_; }  ///< true ones
  /// Index of a distance's time step.
  size_t StepOf(int64_t key, bool px) const;
  /// Biases, noise and counts of one camera's 2D joints.
  void DescribeImages(size_t camera, BudgetCamera* out) const;
  /// Squared errors of 2D joints in units of `sigma_px`, by coordinate.
  std::vector<double> Whitened2d(double sigma_px) const;
  /// Squared Mahalanobis distances of the joints of the take as it is, with and without the calibration's covariance; the rig's
  /// world is taken for the truth's.
  std::vector<double> SquaredErrors(const geometry::Rig& rig, bool with_calibration, double* sigma_px) const;

 private:
  struct Identity {
    int person = -1;
    bool swapped = false;
  };
  struct ImageTruth {
    std::vector<std::vector<std::optional<Eigen::Vector2d>>> px;  // [person][joint]
    std::vector<Identity> seen;                                   // of each detected person
  };
  using PersonOf = std::vector<int>;

  ImageTruth TruthOfImage(const DetectedFrame& frame, size_t camera) const;
  std::vector<Identity> Identify(const std::vector<DetectedPerson>& people, const ImageTruth& truth, double limit_px) const;
  double Cost(const DetectedPerson& person, const std::vector<std::optional<Eigen::Vector2d>>& px, bool swapped,
              double limit_px) const;
  void CollectResiduals();
  DetectedFrame FrameWith(size_t frame, const Truths& truths, int only) const;
  void AddMissed(size_t frame, size_t camera, bool exact, int only, std::vector<DetectedPerson>* people) const;
  bool Missed(size_t frame, size_t camera, size_t person) const;
  TakeProblem Problem(const geometry::Rig& rig, const Truths& truths, int only) const;
  std::vector<PersonOf> Match(const TakeProblem& problem, const std::vector<Point>& points, int only) const;
  const std::optional<Eigen::Vector3d>* TrueJoint(const PointLabel& label, const PersonOf& person_of) const;
  void Score(const geometry::Rig& rig, const TakeProblem& problem, int only, BudgetErrors* errors) const;
  void ScoreHeldOut(const TakeProblem& problem, const PointSolver& solve, const std::vector<PersonOf>& persons,
                    BudgetErrors* errors) const;
  int64_t KeyOf(const PointLabel& label, int person) const;

  const BudgetTake& take_;
  const BudgetTruth& truth_;
  RunContext run_;
  std::vector<size_t> mirror_;                           // joint -> the one on the other side
  std::vector<std::vector<ImageTruth>> images_;          // [frame][camera]
  std::vector<std::vector<Eigen::Vector2d>> residuals_;  // [camera]
  std::vector<std::pair<size_t, size_t>> filmed_;        // [camera] first and last frame with people
  std::map<int, size_t> steps_;
  size_t num_persons_ = 0, num_joints_ = 0, stride_ = 1;
};

}  // namespace mvstudio::triangulate::internal
