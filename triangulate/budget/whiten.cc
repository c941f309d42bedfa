#include "triangulate/budget/whiten.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "core/units.h"
#include "geometry/rig/alignment.h"
#include "geometry/rig/rig_covariance.h"
#include "triangulate/budget/reliability.h"
#include "triangulate/budget/substitute.h"

namespace mvstudio::triangulate {
namespace internal {

std::vector<double> Substitution::Whitened2d(double sigma_px) const {
  std::vector<double> squared;
  for (const auto& errors : residuals_) {
    for (const Eigen::Vector2d& r : errors) {
      for (int k = 0; k < 2; ++k) squared.push_back(r[k] * r[k] / (sigma_px * sigma_px));
    }
  }
  return squared;
}

std::vector<double> Substitution::SquaredErrors(const geometry::Rig& rig, bool with_calibration, double* sigma_px) const {
  const TakeProblem problem = Problem(rig, Sets(0), -1);
  *sigma_px = problem.sigma_px;
  TakeOptions options = take_.options;
  options.select_views |= options.method.IsAuto();
  options.calibration_covariance = with_calibration;
  const std::vector<Point> points = SolvePoints(problem, SolverFor(rig, problem, options, options.method), run_.num_threads);
  const std::vector<PersonOf> persons = Match(problem, points, -1);
  std::vector<double> squared;
  for (size_t i = 0; i < points.size(); ++i) {
    const auto step = steps_.find(problem.labels[i].frame);
    if (step == steps_.end() || points[i].status != Status::kOk) continue;
    const auto* x = TrueJoint(problem.labels[i], persons[step->second]);
    if (!x) continue;
    const Eigen::Vector3d error = points[i].x_in_world - **x;
    squared.push_back(error.dot(points[i].covariance.ldlt().solve(error)));
  }
  return squared;
}

}  // namespace internal

std::vector<double> WhitenedOffsets(const BudgetTake& take, const BudgetTruth& truth) {
  std::vector<double> squared;
  for (size_t r = 0; r < take.clocks.size(); ++r) {
    if (take.sigma_frames[r] != 0) continue;
    for (size_t c = 0; c < take.clocks.size(); ++c) {
      const double stated = take.clocks[c].offset_frames - take.clocks[r].offset_frames;
      const double error = stated - (truth.offset_frames[c] - truth.offset_frames[r]), sigma = take.sigma_frames[c];
      if (sigma > 0 && std::isfinite(error)) squared.push_back(error * error / (sigma * sigma));
    }
    break;
  }
  return squared;
}

WhitenedJoints WhitenJoints(BudgetTake take, const BudgetTruth& truth, const RunContext& run) {
  constexpr double kSameWorldM = 0.05, kSameWorldDeg = 3;
  const geometry::RigDifference difference = CompareRigs(take.rig, truth.rig);
  const geometry::Rigid3& moved = difference.reference_from_rig;
  const bool same = moved.translation.norm() < kSameWorldM &&
                    RadToDeg(geometry::RotationAngle(moved.rotation, Eigen::Quaterniond::Identity())) < kSameWorldDeg;
  // A fit onto the truth takes errors away that the covariance states. Put together at one camera, both are relative to it.
  geometry::Rig at_first = take.rig;
  if (difference.status == Status::kOk && !same) {
    at_first = InWorld(RelativeToFirst(take.rig), Inverse(truth.rig.cameras[0].cam_from_world));
    take.rig = InWorld(take.rig, moved);
  }
  internal::CentreClocks(truth, &take.clocks);
  const internal::Substitution substitution(take, truth, run);
  WhitenedJoints joints;
  double sigma_px = 0;
  joints.without_rig = substitution.SquaredErrors(take.rig, false, &sigma_px);
  if (StatedCovarianceOf(take.rig).AnyKnown()) joints.with_rig = substitution.SquaredErrors(at_first, true, &sigma_px);
  joints.detected = substitution.Whitened2d(sigma_px);
  return joints;
}

}  // namespace mvstudio::triangulate
