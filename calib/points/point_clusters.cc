#include "calib/points/point_clusters.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "calib/points/point_problem.h"

namespace mvstudio::calib {
namespace {

/// Normal equations of the cameras and lenses alone; nothing where an observation does not project.
bool ReducedAt(const PointScene& scene, const std::vector<PointObservation>& observations, const PointBundleOptions& options,
               ReducedSystem* out, std::vector<int>* camera_columns = nullptr) {
  PointProblem problem(scene, observations, options, PointProblem::Blocks::kPoints, 0);
  for (size_t c = 0; camera_columns && c < scene.cam_from_world.size(); ++c) {
    if (problem.camera_column(static_cast<int>(c)) >= 0) camera_columns->push_back(problem.camera_column(static_cast<int>(c)));
  }
  SchurSystem system;
  problem.AllocateSystem(&system);
  problem.Try(Eigen::VectorXd::Zero(system.g.size()), Eigen::MatrixXd::Zero(3, system.num_blocks()));
  if (!problem.LinearizeTrial(&system)) return false;
  *out = Reduce(system, 0, options.num_threads);
  out->h.triangularView<Eigen::StrictlyUpper>() = out->h.transpose().triangularView<Eigen::StrictlyUpper>();
  return true;
}

bool IsFixed(const PointBundleOptions& options, int point) {
  const auto i = static_cast<size_t>(point);
  return i < options.fix_point.size() && options.fix_point[i];
}

/// Observations by the cube of their point; those of fixed points each alone.
std::vector<std::vector<PointObservation>> Clusters(const PointScene& scene, const std::vector<PointObservation>& observations,
                                                    const PointBundleOptions& options, double cell) {
  std::map<Cube, std::vector<PointObservation>> cubes;
  std::vector<std::vector<PointObservation>> clusters;
  for (const PointObservation& o : observations) {
    if (!(o.weight > 0)) continue;
    if (IsFixed(options, o.point_idx))
      clusters.push_back({o});
    else
      cubes[CubeOf(scene.points.col(o.point_idx), cell)].push_back(o);
  }
  for (auto& [cube, inside] : cubes) clusters.push_back(std::move(inside));
  return clusters;
}

struct SandwichSums {
  Eigen::MatrixXd found, expected;  ///< covariance of the unknowns by clusters, and what independent errors would give
};

void Add(const ReducedSystem& own, const Eigen::MatrixXd& covariance, SandwichSums* sums) {
  const Eigen::VectorXd moved = covariance * own.g;
  const Eigen::MatrixXd share = covariance * own.h, alone = share * covariance;
  sums->found += moved * moved.transpose();
  sums->expected += alone - share * alone;
}

/// Largest over the cameras of trace(C^-1 found) / trace(C^-1 expected), C being the covariance of the camera's pose.
double LargestRatio(const SandwichSums& sums, const Eigen::MatrixXd& covariance, const std::vector<int>& cameras) {
  double largest = 0;
  for (const int c : cameras) {
    const Eigen::LDLT<Eigen::MatrixXd> pose(covariance.block<6, 6>(c, c));
    const double found = pose.solve(sums.found.block<6, 6>(c, c)).trace(),
                 expected = pose.solve(sums.expected.block<6, 6>(c, c)).trace();
    if (expected > 0 && std::isfinite(found)) largest = std::max(largest, found / expected);
  }
  return largest;
}

}  // namespace

double SceneSide(const PointScene& scene, const std::vector<PointObservation>& observations,
                 const PointBundleOptions& options) {
  std::array<std::vector<double>, 3> values;
  for (const PointObservation& o : observations) {
    if (!(o.weight > 0) || IsFixed(options, o.point_idx)) continue;
    for (size_t k = 0; k < 3; ++k) values[k].push_back(scene.points(static_cast<Eigen::Index>(k), o.point_idx));
  }
  double side = 0;
  for (size_t k = 0; k < 3 && !values[k].empty(); ++k) {
    std::sort(values[k].begin(), values[k].end());
    const size_t n = values[k].size();
    side = std::max(side, values[k][n - 1 - n / 20] - values[k][n / 20]);
  }
  return side;
}

Cube CubeOf(const Eigen::Vector3d& x, double cell) {
  Cube cube{};
  for (size_t k = 0; k < 3; ++k)
    cube[k] = static_cast<int64_t>(std::floor(std::clamp(x[static_cast<Eigen::Index>(k)] / cell, -1e9, 1e9)));
  return cube;
}

ClusterInflation InflationByClusters(const PointScene& scene, const std::vector<PointObservation>& observations,
                                     const PointBundleOptions& options, double sigma_px) {
  ClusterInflation best;
  PointBundleOptions scaled = options;
  if (scaled.distance) scaled.distance->sigma /= sigma_px;
  ReducedSystem all;
  std::vector<int> cameras;
  if (!ReducedAt(scene, observations, scaled, &all, &cameras) || all.g.size() == 0 || cameras.empty()) return best;
  const Eigen::MatrixXd covariance = all.h.ldlt().solve(Eigen::MatrixXd::Identity(all.h.rows(), all.h.cols()));
  scaled.distance.reset();  // an observation of its own, with no residual
  const double side = SceneSide(scene, observations, options);
  if (!(side > 0) || !std::isfinite(side)) return best;
  constexpr int kFewest = 40;  // the largest of several cameras' ratios is too large by chance with fewer
  for (const double parts : {2.0, 4.0, 8.0, 16.0}) {
    const auto clusters = Clusters(scene, observations, options, side / parts);
    if (static_cast<int>(clusters.size()) < kFewest) continue;
    SandwichSums sums = {Eigen::MatrixXd::Zero(all.h.rows(), all.h.cols()), Eigen::MatrixXd::Zero(all.h.rows(), all.h.cols())};
    for (const std::vector<PointObservation>& cluster : clusters) {
      ReducedSystem own;
      if (!ReducedAt(scene, cluster, scaled, &own)) return best;
      Add(own, covariance, &sums);
    }
    const double factor = LargestRatio(sums, covariance, cameras) / (sigma_px * sigma_px);
    if (factor > best.factor) best = {factor, static_cast<int>(clusters.size())};
  }
  return best;
}

}  // namespace mvstudio::calib
