#include "calib/covariance/uncertainty.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "calib/covariance/omitted_terms.h"
#include "core/check.h"

namespace mvstudio::calib {
namespace {

constexpr double kRankTolerance = 1e-12;  // of eigenvalues, that is the square of a ratio of singular values
constexpr double kNamedShare = 0.15;      // of the largest component of a null direction
constexpr double kParallelDeg = 3;        // boards tilted less than this count as parallel to the image

/// A group of unknowns that a user knows by one name.
struct Group {
  std::string name;
  std::vector<int> columns;
  int camera = -1;
  bool is_focal = false, is_lens = false;
};

void AddLensGroups(const RigState& state, int c, int column, int first_param, std::vector<Group>* groups) {
  const std::string of = " of " + state.cameras[c].name;
  const std::vector<std::string> names = geometry::ParamNames(state.cameras[c]);
  Group focal{"focal length" + of, {}, c, true, true}, center{"principal point" + of, {}, c, false, true},
      lens{"distortion" + of, {}, c, false, true};
  for (int i = first_param; i < static_cast<int>(names.size()); ++i) {
    Group& group = i < 2 ? focal : i < 4 ? center : lens;
    group.columns.push_back(column + i - first_param);
  }
  for (const Group& group : {focal, center, lens}) {
    if (!group.columns.empty()) groups->push_back(group);
  }
}

Group Range(const std::string& name, int first, int count, int camera) {
  Group group{name, {}, camera, false, false};
  for (int i = 0; i < count; ++i) group.columns.push_back(first + i);
  return group;
}

std::vector<Group> MakeGroups(const RigState& state, const RigColumns& columns) {
  std::vector<Group> groups;
  std::vector<bool> named(columns.total, false);
  for (int c = 0; c < static_cast<int>(state.cameras.size()); ++c) {
    if (columns.lens[c] >= 0 && !named[columns.lens[c]]) {
      named[columns.lens[c]] = true;
      AddLensGroups(state, c, columns.lens[c], columns.first_param[c], &groups);
    }
    const std::string of = " of " + state.cameras[c].name;
    if (columns.camera[c] >= 0) {
      groups.push_back(Range("direction" + of, columns.camera[c], 3, c));
      groups.push_back(Range("position" + of, columns.camera[c] + 3, 3, c));
    }
    if (columns.time[c] >= 0) groups.push_back(Range("time offset" + of, columns.time[c], columns.num_time, c));
  }
  for (size_t b = 0; b < columns.board.size(); ++b) {
    const std::string of = " of board " + std::to_string(b);
    if (columns.board[b] >= 0) groups.push_back(Range("place" + of, columns.board[b], 6, -1));
    if (columns.warp[b] >= 0) groups.push_back(Range("bend" + of, columns.warp[b], 2, -1));
    if (columns.stretch[b] >= 0) groups.push_back(Range("stretch" + of, columns.stretch[b], 2, -1));
  }
  return groups;
}

/// Largest tilt of the boards of one camera against its image, degrees.
double LargestTilt(const std::vector<View>& views, const RigState& state, int camera) {
  double smallest_cosine = 1;
  for (const View& view : views) {
    if (view.camera_idx != camera || !(view.weights.array() > 0).any()) continue;
    const Eigen::Vector3d normal = CamFromBoard(view, state).rotation * Eigen::Vector3d::UnitZ();
    smallest_cosine = std::min(smallest_cosine, std::abs(normal.z()));
  }
  return std::acos(std::min(1.0, smallest_cosine)) * 180 / M_PI;
}

/// Length of the part of a direction that each group has.
std::vector<double> Shares(const Eigen::VectorXd& direction, const std::vector<Group>& groups) {
  std::vector<double> shares;
  for (const Group& group : groups) {
    double sum = 0;
    for (int column : group.columns) sum += direction[column] * direction[column];
    shares.push_back(std::sqrt(sum));
  }
  return shares;
}

/// Cameras whose lenses a direction names.
void AddLenses(const Eigen::VectorXd& direction, const std::vector<Group>& groups, std::vector<int>* cameras) {
  const std::vector<double> shares = Shares(direction, groups);
  const double largest = *std::max_element(shares.begin(), shares.end());
  for (size_t i = 0; i < groups.size(); ++i) {
    const bool known = std::find(cameras->begin(), cameras->end(), groups[i].camera) != cameras->end();
    if (groups[i].is_lens && shares[i] >= kNamedShare * largest && !known) cameras->push_back(groups[i].camera);
  }
}

/// "focal length and distance of cam3 cannot be separated: all its boards are parallel to the image".
std::string Phrase(const Eigen::VectorXd& direction, const std::vector<Group>& groups, const std::vector<View>& views,
                   const RigState& state) {
  const std::vector<double> shares = Shares(direction, groups);
  const double largest = *std::max_element(shares.begin(), shares.end());
  std::string names, cause;
  int count = 0;
  for (size_t i = 0; i < groups.size(); ++i) {
    if (shares[i] < kNamedShare * largest || ++count > 4) continue;
    names += (names.empty() ? "" : ", ") + groups[i].name;
    if (groups[i].is_focal && LargestTilt(views, state, groups[i].camera) < kParallelDeg) {
      names += " and the distance of its boards";
      cause = ": all boards are parallel to the image";
    }
  }
  const bool several = count > 1 || !cause.empty();
  return names + (several ? " cannot be separated" : " cannot be determined") + cause;
}

void NameNullDirections(const Eigen::MatrixXd& directions, const std::vector<View>& views, const RigState& state,
                        RigCovariance* result) {
  const std::vector<Group> groups = MakeGroups(state, result->columns);
  for (Eigen::Index k = 0; k < directions.cols(); ++k) {
    AddLenses(directions.col(k), groups, &result->undetermined_lenses);
    const std::string phrase = Phrase(directions.col(k), groups, views, state);
    if (std::find(result->undetermined.begin(), result->undetermined.end(), phrase) == result->undetermined.end())
      result->undetermined.push_back(phrase);
  }
  result->status = Status::kDegenerate;
  result->message = result->undetermined.front();
  if (result->undetermined.size() > 1) result->message += " (and " + std::to_string(result->undetermined.size() - 1) + " more)";
  result->message += "; show the board tilted, nearer and farther, and to cameras in pairs";
}

/// Columns of the joint covariance for the lens parameters and the pose of a camera; -1 for what is fixed.
std::vector<int> ColumnsOfCamera(const RigColumns& columns, const RigState& state, int camera_idx) {
  const int p = static_cast<int>(state.cameras[camera_idx].params.size());
  std::vector<int> ids(p + 6, -1);
  for (int i = columns.first_param[camera_idx]; columns.lens[camera_idx] >= 0 && i < p; ++i)
    ids[i] = columns.lens[camera_idx] + i - columns.first_param[camera_idx];
  for (int i = 0; columns.camera[camera_idx] >= 0 && i < 6; ++i) ids[p + i] = columns.camera[camera_idx] + i;
  return ids;
}

Eigen::MatrixXd Pick(const Eigen::MatrixXd& joint, const std::vector<int>& columns) {
  const Eigen::Index n = static_cast<Eigen::Index>(columns.size());
  Eigen::MatrixXd picked = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      if (columns[i] >= 0 && columns[j] >= 0) picked(i, j) = joint(columns[i], columns[j]);
    }
  }
  return picked;
}

void SplitCovariance(const RigState& state, RigCovariance* result) {
  for (int c = 0; c < static_cast<int>(state.cameras.size()); ++c) {
    const Eigen::Index p = state.cameras[c].params.size();
    const Eigen::MatrixXd both = CameraCovariance(*result, state, c);
    result->params.push_back(both.topLeftCorner(p, p));
    result->cam_from_world.push_back(both.bottomRightCorner<6, 6>());
  }
}

/// Equations that are no numbers: a lens at the edge of what it can project.
void NameNonFinite(const Eigen::MatrixXd& normal, const RigState& state, RigCovariance* result) {
  for (const Group& group : MakeGroups(state, result->columns)) {
    const bool broken = std::any_of(group.columns.begin(), group.columns.end(),
                                    [&](int column) { return !std::isfinite(normal(column, column)); });
    auto& cameras = result->undetermined_lenses;
    if (broken && group.is_lens && std::find(cameras.begin(), cameras.end(), group.camera) == cameras.end())
      cameras.push_back(group.camera);
    if (broken) result->undetermined.push_back(group.name + " cannot be determined");
  }
  result->status = Status::kDegenerate;
  result->message = result->undetermined.empty() ? "the solution is not finite" : result->undetermined.front();
}

bool AnyWeight(const std::vector<View>& views) {
  return std::any_of(views.begin(), views.end(), [](const View& view) { return (view.weights.array() > 0).any(); });
}

/// Takes the diagonal to 1.
Eigen::VectorXd UnitScale(const Eigen::MatrixXd& normal) {
  Eigen::VectorXd scale(normal.rows());
  for (Eigen::Index i = 0; i < normal.rows(); ++i) scale[i] = normal(i, i) > 0 ? 1 / std::sqrt(normal(i, i)) : 1;
  return scale;
}

/// Sets free what was held, with its covariance: `result` holds that of the others.
void CarryHeld(const std::vector<View>& views, const RigState& state, const BundleOptions& options,
               const Eigen::MatrixXd& inverse, const HeldCovariance& held, RigCovariance* result) {
  const FreedProblem freed = FreeHeld(views, state, options, held);
  const Eigen::MatrixXd normal = ReducedEquations(views, freed.state, freed.options, &result->columns).h;
  result->joint = CovarianceWithHeld(normal, freed.estimated, freed.held, inverse, result->joint, freed.covariance);
}

}  // namespace

ReducedSystem ReducedEquations(const std::vector<View>& views, const RigState& state, const BundleOptions& options,
                               RigColumns* columns) {
  RigProblem problem(views, state, options);
  *columns = problem.columns();
  SchurSystem system;
  problem.AllocateSystem(&system);
  problem.Try(Eigen::VectorXd::Zero(system.g.size()), Eigen::MatrixXd::Zero(6, system.num_blocks()));
  MVS_CHECK(problem.LinearizeTrial(&system), "the solution does not project its own corners");
  ReducedSystem reduced = Reduce(system, 0, options.num_threads);
  reduced.h = Eigen::MatrixXd(reduced.h.selfadjointView<Eigen::Lower>());
  return reduced;
}

Eigen::MatrixXd JointCovariance(const RigCovariance& covariance, const RigState& state) {
  std::vector<int> columns;
  for (size_t c = 0; c < state.cameras.size(); ++c) {
    const std::vector<int> own = ColumnsOfCamera(covariance.columns, state, static_cast<int>(c));
    columns.insert(columns.end(), own.begin(), own.end());
  }
  return Pick(covariance.joint, columns);
}

Eigen::MatrixXd CameraCovariance(const RigCovariance& covariance, const RigState& state, int camera_idx) {
  return Pick(covariance.joint, ColumnsOfCamera(covariance.columns, state, camera_idx));
}

std::vector<int> WeakestLenses(const std::vector<View>& views, const RigState& state, const BundleOptions& options) {
  RigColumns columns;
  const Eigen::MatrixXd normal = ReducedEquations(views, state, options, &columns).h;
  std::vector<int> cameras;
  if (normal.rows() == 0 || !normal.allFinite()) return cameras;
  const Eigen::VectorXd scale = UnitScale(normal);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * normal * scale.asDiagonal());
  AddLenses(eigen.eigenvectors().col(0), MakeGroups(state, columns), &cameras);
  return cameras;
}

RigCovariance ComputeCovariance(const std::vector<View>& views, const RigState& state, const BundleOptions& options,
                                double sigma_px, const HeldCovariance& held) {
  RigCovariance result;
  const ReducedSystem equations = ReducedEquations(views, state, options, &result.columns);
  const Eigen::MatrixXd& normal = equations.h;
  const Eigen::Index n = normal.rows();
  if (!normal.allFinite()) {
    NameNonFinite(normal, state, &result);
    return result;
  }
  if (n == 0 && !AnyWeight(views)) {
    result.status = Status::kDegenerate;
    result.message = "no corner agrees with the others";
    return result;
  }
  const Eigen::VectorXd scale = UnitScale(normal);
  const Eigen::MatrixXd scaled = scale.asDiagonal() * normal * scale.asDiagonal();
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(n);
  if (n > 0) eigen.compute(scaled);  // of nothing, Eigen reads past its end
  const Eigen::VectorXd values = n > 0 ? Eigen::VectorXd(eigen.eigenvalues()) : Eigen::VectorXd();
  const auto null = n == 0 ? 0 : (values.array() < kRankTolerance * values[n - 1]).count();
  if (null > 0) {
    NameNullDirections(eigen.eigenvectors().leftCols(null), views, state, &result);
    return result;
  }
  Eigen::MatrixXd inverse(n, n);
  if (n > 0) {
    const Eigen::MatrixXd root = scale.asDiagonal() * eigen.eigenvectors() * values.cwiseSqrt().cwiseInverse().asDiagonal();
    inverse = root * root.transpose();
  }
  result.joint = sigma_px * sigma_px * inverse;
  const std::vector<Eigen::Index> omitted = OmittedColumns(result.columns, options);
  if (!omitted.empty()) {
    const Eigen::VectorXd shift = OmittedShift(inverse(Eigen::all, omitted), omitted, equations.g);
    result.joint += shift * shift.transpose();
  }
  if (held.any()) CarryHeld(views, state, options, inverse, held, &result);
  SplitCovariance(state, &result);
  return result;
}

RigCovariance ComputeCovariance(const std::vector<View>& views, const RigState& state, const Gauge& gauge, double sigma_px) {
  BundleOptions options;
  options.gauge = gauge;
  return ComputeCovariance(views, state, options, sigma_px);
}

}  // namespace mvstudio::calib
