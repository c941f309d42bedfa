#include "calib/point_clusters.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "calib/point_problem.h"

namespace mvstudio::calib {
namespace {

/// Normal equations of the cameras and lenses alone; nothing where an observation does not project.
bool ReducedAt(const PointScene& scene, const std::vector<PointObservation>& observations, const PointBundleOptions& options,
               ReducedSystem* out) {
  PointProblem problem(scene, observations, options, PointProblem::Blocks::kPoints, 0);
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
  if (!ReducedAt(scene, observations, scaled, &all) || all.g.size() == 0) return best;
  const Eigen::LDLT<Eigen::MatrixXd> solver(all.h);
  scaled.distance.reset();  // an observation of its own, with no residual
  const double extent = SceneSide(scene, observations, options);
  if (!(extent > 0) || !std::isfinite(extent)) return best;
  constexpr int kFewest = 12;
  for (const double parts : {2.0, 4.0, 8.0, 16.0}) {
    const auto clusters = Clusters(scene, observations, options, extent / parts);
    if (static_cast<int>(clusters.size()) < kFewest) continue;
    double trace = 0, expected = 0;
    for (const std::vector<PointObservation>& cluster : clusters) {
      ReducedSystem own;
      if (!ReducedAt(scene, cluster, scaled, &own)) return best;
      const Eigen::MatrixXd share = solver.solve(own.h);
      trace += own.g.dot(solver.solve(own.g));
      expected += share.trace() - share.cwiseProduct(share.transpose()).sum();
    }
    const double upper = 1 + std::sqrt(2 / static_cast<double>(clusters.size()));
    const double factor = expected > 0 ? upper * trace / (sigma_px * sigma_px * expected) : 1;
    if (factor > best.factor) best = {factor, static_cast<int>(clusters.size())};
  }
  return best;
}

}  // namespace mvstudio::calib
