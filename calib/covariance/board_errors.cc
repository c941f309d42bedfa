#include "calib/covariance/board_errors.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

namespace mvstudio::calib {
namespace {

constexpr double kSignificant = 2.5;  // standard deviations
constexpr double kMinEigenvalue = 1e-10;
constexpr size_t kMinUnits = 3;

/// What one unit says of a lens, the poses eliminated.
struct Unit {
  Eigen::MatrixXd information;
  Eigen::VectorXd gradient;
};

struct Units {
  std::map<int, Unit> of_cluster;
  double squares = 0;  // of the residuals that the poses leave
  double num_free = 0;
};

/// Linearised at the view's own pose: of a camera that moved or was late, the rig's pose leaves more than the corners' errors.
std::optional<ViewLinearization> AtOwnPose(const View& view, const geometry::Camera& camera, geometry::Rigid3 pose,
                                           const Eigen::Matrix3Xd& corners) {
  constexpr int kSteps = 5;
  for (int i = 0; i < kSteps; ++i) {
    const auto linear = LinearizeView(view, camera, pose, false, &corners);
    if (!linear) return std::nullopt;
    const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> normals(linear->d_pose.transpose() * linear->d_pose);
    if (normals.info() != Eigen::Success || !normals.isPositive()) return std::nullopt;
    pose = geometry::Perturb(-normals.solve(linear->d_pose.transpose() * linear->residuals), pose);
  }
  return LinearizeView(view, camera, pose, true, &corners);
}

void AddView(const View& view, int cluster, const RigState& state, Units* units) {
  const Eigen::Matrix3Xd corners = BentCorners(view, state);
  const geometry::Camera& camera = state.cameras[static_cast<size_t>(view.camera_idx)];
  const auto linear = AtOwnPose(view, camera, CamFromBoard(view, state), corners);
  if (!linear) return;
  const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> pose(linear->d_pose.transpose() * linear->d_pose);
  if (pose.info() != Eigen::Success || !pose.isPositive()) return;
  const Eigen::MatrixXd lens = linear->d_lens - linear->d_pose * pose.solve(linear->d_pose.transpose() * linear->d_lens);
  const Eigen::VectorXd residuals =
      linear->residuals - linear->d_pose * pose.solve(linear->d_pose.transpose() * linear->residuals);
  if (!lens.allFinite() || !residuals.allFinite()) return;
  const Eigen::Index p = lens.cols();
  auto [unit, is_new] = units->of_cluster.try_emplace(cluster);
  if (is_new) unit->second = {Eigen::MatrixXd::Zero(p, p), Eigen::VectorXd::Zero(p)};
  unit->second.information += lens.transpose() * lens;
  unit->second.gradient += lens.transpose() * residuals;
  units->squares += residuals.squaredNorm();
  units->num_free += 2.0 * static_cast<double>((view.weights.array() > 0).count()) - 6;
}

/// Takes the sum of the information to the identity, directions that it does not determine left out: (p, q).
Eigen::MatrixXd Whitening(const Eigen::MatrixXd& information) {
  const Eigen::VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * information * scale.asDiagonal());
  const Eigen::VectorXd& values = eigen.eigenvalues();
  const Eigen::Index left_out = (values.array() < kMinEigenvalue * values[values.size() - 1]).count();
  const Eigen::Index kept = values.size() - left_out;
  return scale.asDiagonal() * eigen.eigenvectors().rightCols(kept) * values.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal();
}

double RatioOf(const Units& units) {
  if (units.of_cluster.size() < kMinUnits) return 1;
  const Eigen::Index p = units.of_cluster.begin()->second.gradient.size();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(p, p);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(p);
  for (const auto& [cluster, unit] : units.of_cluster) information += unit.information, gradient += unit.gradient;
  const Eigen::MatrixXd whitening = Whitening(information);
  const Eigen::VectorXd rest = whitening.transpose() * gradient;  // 0 at the solution of this camera alone
  const double free = units.num_free - static_cast<double>(rest.size());
  const double variance = (units.squares - rest.squaredNorm()) / free;
  if (!(free > 0) || !(variance > 0)) return 1;
  double found = 0, expected = 0, spread = 0;
  for (const auto& [cluster, unit] : units.of_cluster) {
    const Eigen::MatrixXd share = whitening.transpose() * unit.information * whitening;
    const Eigen::MatrixXd left = share - share * share;
    found += (whitening.transpose() * unit.gradient - share * rest).squaredNorm() / variance;
    expected += left.trace();
    spread += 2 * left.squaredNorm();
  }
  const bool larger = expected > 0 && found - expected > kSignificant * std::sqrt(spread);
  return larger ? found / expected : 1;
}

}  // namespace

std::vector<double> VarianceByBoards(const std::vector<View>& views, const std::vector<int>& cluster_of_view,
                                     const RigState& state, const std::vector<bool>& fixed) {
  std::map<int, Units> of_lens;
  const auto lens_of = [&](size_t c) { return state.lens_group.empty() ? static_cast<int>(c) : state.lens_group[c]; };
  for (size_t v = 0; v < views.size(); ++v) {
    const auto c = static_cast<size_t>(views[v].camera_idx);
    const bool held = c < fixed.size() && fixed[c];
    if (held || state.cameras[c].model == geometry::LensModel::kSplined || !(views[v].weights.array() > 0).any()) continue;
    AddView(views[v], cluster_of_view[v], state, &of_lens[lens_of(c)]);
  }
  std::vector<double> ratio(state.cameras.size(), 1);
  for (size_t c = 0; c < ratio.size(); ++c) {
    const auto units = of_lens.find(lens_of(c));
    if (units != of_lens.end()) ratio[c] = RatioOf(units->second);
  }
  return ratio;
}

void DiscountByBoards(const std::vector<double>& ratio, std::vector<View>* views) {
  for (View& view : *views) view.weights /= ratio[static_cast<size_t>(view.camera_idx)];
}

}  // namespace mvstudio::calib
