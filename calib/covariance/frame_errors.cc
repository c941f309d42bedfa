#include "calib/covariance/frame_errors.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "calib/covariance/uncertainty.h"

namespace mvstudio::calib {
namespace {

constexpr size_t kMinUnitsOfRig = 6;

/// Columns of the rig for each column of a part of it.
std::vector<int> ColumnsInRig(const RigColumns& part, const RigColumns& rig, const RigState& state) {
  std::vector<int> of(static_cast<size_t>(part.total), -1);
  const auto copy = [&](int first, int first_in_rig, int count) {
    for (int i = 0; first >= 0 && i < count; ++i) of[static_cast<size_t>(first + i)] = first_in_rig + i;
  };
  for (size_t c = 0; c < part.camera.size(); ++c) {
    copy(part.lens[c], rig.lens[c], part.num_lens(static_cast<int>(c), state));
    copy(part.camera[c], rig.camera[c], 6);
    copy(part.time[c], rig.time[c], part.num_time);
  }
  for (size_t b = 0; b < part.board.size(); ++b) {
    copy(part.board[b], rig.board[b], 6);
    copy(part.warp[b], rig.warp[b], 2);
    copy(part.stretch[b], rig.stretch[b], 2);
  }
  return of;
}

/// Columns of the poses that a part of the rig has.
std::vector<int> PoseColumns(const RigColumns& part, const RigColumns& rig) {
  std::vector<int> poses;
  for (size_t c = 0; c < part.camera.size(); ++c) {
    for (int i = 0; part.camera[c] >= 0 && i < 6; ++i) poses.push_back(rig.camera[c] + i);
  }
  return poses;
}

/// Of a symmetric positive matrix, scaled to unit diagonal first.
std::optional<Eigen::MatrixXd> Inverse(const Eigen::MatrixXd& normal) {
  if (normal.rows() == 0 || !normal.allFinite() || !(normal.diagonal().array() > 0).all()) return std::nullopt;
  const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> scaled(scale.asDiagonal() * normal * scale.asDiagonal());
  if (scaled.info() != Eigen::Success) return std::nullopt;
  return scale.asDiagonal() * scaled.solve(Eigen::MatrixXd::Identity(normal.rows(), normal.cols())) * scale.asDiagonal();
}

struct Sums {
  double found = 0, expected = 0, spread = 0;
};

/// The whole rig, as the units are held against it.
struct Whole {
  const RigState& state;
  BundleOptions of_unit;
  RigColumns columns;
  Eigen::MatrixXd covariance;
  Eigen::VectorXd rest;  // of terms that the lenses omit, and of weights that are no longer the solution's
  double variance = 1;
};

/// What the boards of one unit say of the poses, against what independent corners would say.
void AddUnit(const std::vector<View>& views, const Whole& whole, Sums* sums) {
  RigColumns part;
  const ReducedSystem unit = ReducedEquations(views, whole.state, whole.of_unit, &part);
  const std::vector<int> own = ColumnsInRig(part, whole.columns, whole.state), poses = PoseColumns(part, whole.columns);
  if (poses.empty() || !unit.h.allFinite() || !unit.g.allFinite()) return;
  const Eigen::LLT<Eigen::MatrixXd> of_poses(whole.covariance(poses, poses));
  if (of_poses.info() != Eigen::Success) return;
  const Eigen::MatrixXd draw = of_poses.matrixL().solve(whole.covariance(poses, own));
  const Eigen::VectorXd gradient = unit.g - unit.h * whole.rest(own);
  const Eigen::MatrixXd drawn = draw * unit.h;  // narrow: the poses of one unit
  const Eigen::MatrixXd left = drawn * draw.transpose() - drawn * whole.covariance(own, own) * drawn.transpose();
  sums->found += (draw * gradient).squaredNorm() / whole.variance;
  sums->expected += left.trace();
  sums->spread += 2 * left.squaredNorm();
}

std::map<int, std::vector<View>> ClustersOf(const std::vector<View>& views, const std::vector<int>& cluster_of_frame) {
  std::map<int, std::vector<View>> clusters;
  for (const View& view : views) {
    const int cluster = cluster_of_frame[static_cast<size_t>(view.frame)];
    if (cluster >= 0 && (view.weights.array() > 0).any()) clusters[cluster].push_back(view);
  }
  return clusters;
}

/// Units of a rig with so many unknowns that take no longer than its covariance: each costs the square of what it sees.
size_t MostUnits(int unknowns) {
  constexpr double kLeast = 20, kMost = 400, kOfMost = 500;
  return static_cast<size_t>(std::clamp(kMost * std::pow(kOfMost / std::max(1, unknowns), 2), kLeast, kMost));
}

bool AnySplined(const RigState& state) {
  return std::any_of(state.cameras.begin(), state.cameras.end(),
                     [](const geometry::Camera& camera) { return camera.model == geometry::LensModel::kSplined; });
}

}  // namespace

double PoseVarianceByFrames(const std::vector<View>& views, const std::vector<int>& cluster_of_frame, const RigState& state,
                            const BundleOptions& options, double sigma_px) {
  const std::map<int, std::vector<View>> clusters = ClustersOf(views, cluster_of_frame);
  if (clusters.size() < kMinUnitsOfRig || AnySplined(state) || !(sigma_px > 0)) return 1;
  Whole whole{state, options, {}, {}, {}, sigma_px * sigma_px};
  whole.of_unit.lens_prior.clear();
  const ReducedSystem all = ReducedEquations(views, state, options, &whole.columns);
  const auto covariance = Inverse(all.h);
  if (!covariance) return 1;
  whole.covariance = *covariance, whole.rest = *covariance * all.g;
  Sums sums;
  const size_t most = MostUnits(whole.columns.total), step = (clusters.size() + most - 1) / most;
  size_t index = 0;
  for (const auto& [cluster, seen] : clusters) {
    if (index++ % step == 0) AddUnit(seen, whole, &sums);
  }
  const bool larger = sums.expected > 0 && sums.found > sums.expected + std::sqrt(sums.spread);
  return larger ? sums.found / sums.expected : 1;
}

}  // namespace mvstudio::calib
