#include "calib/keypoints/bundle.h"

#include <algorithm>
#include <cmath>

#include "calib/points/point_problem.h"

namespace mvstudio::calib {
namespace {

struct Bundle {
  PointScene scene;
  std::vector<PointObservation> observations;
  PointBundleOptions options;
};

Bundle MakeBundle(const geometry::Rig& rig, const std::vector<KeypointFit>& fits, const KeypointFreedom& freedom,
                  int num_threads) {
  Bundle bundle;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    bundle.scene.lenses.push_back(rig.cameras[c].camera);
    bundle.scene.lens_of_camera.push_back(static_cast<int>(c));
    bundle.scene.cam_from_world.push_back(rig.cameras[c].cam_from_world);
  }
  std::vector<Eigen::Vector3d> points;
  for (const KeypointFit& fit : fits) {
    if (!fit.ok) continue;
    for (const triangulate::Observation& seen : fit.joint->seen)
      bundle.observations.push_back({seen.camera_idx, static_cast<int>(points.size()), seen.px, 1});
    points.push_back(fit.x_in_world);
  }
  bundle.scene.points.resize(3, static_cast<Eigen::Index>(points.size()));
  for (size_t p = 0; p < points.size(); ++p) bundle.scene.points.col(static_cast<Eigen::Index>(p)) = points[p];
  bundle.options.fix_camera = freedom.fix_pose;
  bundle.options.lens_directions = freedom.lens_directions;
  bundle.options.num_threads = num_threads;
  return bundle;
}

int NumUnknowns(const geometry::Rig& rig, const KeypointFreedom& freedom) {
  int unknowns = 0;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    unknowns += c < freedom.fix_pose.size() && freedom.fix_pose[c] ? 0 : 6;
    if (c < freedom.lens_directions.size()) unknowns += static_cast<int>(freedom.lens_directions[c].cols());
  }
  return unknowns;
}

Status Adjust(Bundle* bundle, double cauchy_px) {
  PointProblem problem(bundle->scene, bundle->observations, bundle->options, PointProblem::Blocks::kPoints, cauchy_px);
  SchurSystem system;
  problem.AllocateSystem(&system);
  SchurLmOptions lm;
  lm.max_iterations = 100;
  lm.cost_tolerance = 1e-6;
  lm.negligible_cost = 1e-20 * static_cast<double>(bundle->observations.size());
  lm.num_threads = bundle->options.num_threads;
  const SchurLmReport report = SolveSchurLm(&problem, &system, lm);
  bundle->scene = problem.scene();
  return report.status;
}

double Cost(const std::vector<KeypointFit>& fits, double* count) {
  double cost = 0;
  *count = 0;
  for (const KeypointFit& fit : fits)
    if (fit.ok) cost += fit.cost, *count += static_cast<double>(fit.joint->seen.size());
  return cost;
}

bool HasEnough(const geometry::Rig& rig, const KeypointFreedom& freedom, const KeypointSolution& solution) {
  return 2 * solution.num_observations >= NumUnknowns(rig, freedom) + 3 * solution.num_joints + 10;
}

/// The rounds of SolveKeypoints; the last looks for all points anew, but not where `start_fits` are given. From the scale of
/// the noise in `scale`; 0: plain squares.
KeypointSolution SolveRounds(const geometry::Rig& start, const std::vector<KeypointJoint>& joints,
                             const KeypointFreedom& freedom, double cauchy_px, double scale, int num_threads,
                             const std::vector<KeypointFit>* start_fits) {
  constexpr int kMaxRounds = 12;
  constexpr double kSmallestScalePx = 1e-6, kNear = 0.03;  // of the cost: the cameras barely moved
  KeypointSolution solution;
  solution.rig = start;
  double before = INFINITY;
  std::vector<KeypointFit> fits;
  bool anew = !start_fits;  // look for the points anew, not among the minima that are known
  for (int round = 0; round < kMaxRounds; ++round) {
    if (anew) fits = FitKeypoints(solution.rig, joints, scale, 2, num_threads);
    if (!anew) fits = round == 0 ? *start_fits : RefitKeypoints(solution.rig, fits, scale, num_threads);
    const double estimated = std::max(CauchyScale(fits), kSmallestScalePx), last = scale;
    if (!(cauchy_px > 0)) scale = estimated;
    double count = 0;
    const double cost = Cost(fits, &count) / std::max(count, 1.0);
    Bundle bundle = MakeBundle(solution.rig, fits, freedom, num_threads);
    solution.num_joints = static_cast<int>(bundle.scene.points.cols());
    solution.num_observations = static_cast<int>(bundle.observations.size());
    if (!HasEnough(start, freedom, solution)) {
      solution.status = Status::kTooFewViews;
      solution.message = std::to_string(solution.num_joints) + " points seen by two cameras are too few to adjust the rig";
      return solution;
    }
    solution.cauchy_px = scale, solution.cost = cost * count;
    const bool settled = std::abs(scale - last) <= 0.01 * scale && std::abs(before - cost) <= 1e-4 * std::abs(cost);
    if ((settled && (anew || start_fits)) || scale <= kSmallestScalePx) break;
    anew = !start_fits && (settled || !(std::abs(before - cost) < kNear * cost));
    before = cost;
    solution.status = Adjust(&bundle, scale);
    for (size_t c = 0; c < start.cameras.size(); ++c) {
      solution.rig.cameras[c].camera = bundle.scene.lenses[c];
      solution.rig.cameras[c].cam_from_world = bundle.scene.cam_from_world[c];
    }
  }
  return solution;
}

}  // namespace

KeypointSolution SolveKeypoints(const geometry::Rig& start, const std::vector<KeypointJoint>& joints,
                                const KeypointFreedom& freedom, double cauchy_px, int num_threads,
                                const std::vector<KeypointFit>* start_fits) {
  constexpr size_t kCoarse = 6000;  // observations that bring a start near; all of them together then end in a few steps
  geometry::Rig from = start;
  for (geometry::RigCamera& camera : from.cameras) camera.params_covariance.reset(), camera.cam_from_world_covariance.reset();
  from.joint_covariance.reset();
  double scale = cauchy_px;
  if (!start_fits && NumObservations(joints) > 2 * kCoarse) {
    const KeypointSolution coarse =
        SolveRounds(from, ThinnedTo(joints, kCoarse), freedom, cauchy_px, scale, num_threads, nullptr);
    const bool usable = coarse.status == Status::kOk || coarse.status == Status::kNotConverged;
    if (usable) from = coarse.rig, scale = coarse.cauchy_px;
  }
  KeypointSolution solution = SolveRounds(from, joints, freedom, cauchy_px, scale, num_threads, start_fits);
  if (solution.status == Status::kUndefined)
    solution.status = Status::kBehindCamera, solution.message = "the start puts the points behind the cameras";
  // Ends that creep along a flat valley are solutions to the accuracy that the noise allows.
  if (solution.status == Status::kNotConverged) solution.status = Status::kOk;
  return solution;
}

}  // namespace mvstudio::calib
