#include "calib/points/point_resection.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "calib/points/point_bundle.h"
#include "calib/points/resection_problem.h"
#include "core/check.h"
#include "core/statistics.h"
#include "geometry/lens/lens_derivatives.h"
#include "geometry/rigid/cross_matrix.h"
#include "geometry/rigid/decompositions.h"
#include "geometry/solve/least_squares.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Over (pose 6, lens directions of all cameras).
using Normal = geometry::NormalEquations<Eigen::Dynamic>;

/// First unknown of each camera's lens directions, and the number of unknowns.
std::vector<Eigen::Index> LensColumns(const ResectionProblem& problem) {
  std::vector<Eigen::Index> columns = {6};
  for (const Eigen::MatrixXd& d : problem.directions) columns.push_back(columns.back() + d.cols());
  return columns;
}

/// A click's residual and its derivatives.
struct ClickLinearization {
  Eigen::Vector2d residual;
  Eigen::MatrixXd by_unknowns;  // (2, X)
  Eigen::MatrixXd by_given;     // (2, P + 6): the camera's lens parameters and cam_from_rig
};

std::optional<ClickLinearization> LinearizeClick(const ResectionProblem& problem, const PointClick& click,
                                                 const std::vector<Eigen::Index>& columns) {
  const auto c = static_cast<size_t>(click.camera_idx);
  const Eigen::Vector3d rotated = problem.rig_from_world.rotation * problem.x_in_world.col(click.point_idx);
  const Rigid3& cam_from_rig = problem.cam_from_rig[c];
  const Eigen::Vector3d rotated_in_cam = cam_from_rig.rotation * Eigen::Vector3d(rotated + problem.rig_from_world.translation);
  geometry::LensDerivatives d;
  Eigen::Vector2d px;
  if (!geometry::ProjectLens(problem.cameras[c], rotated_in_cam + cam_from_rig.translation, &px, &d)) return std::nullopt;
  const Eigen::MatrixXd& directions = problem.directions[c];
  const Eigen::Index p = problem.cameras[c].params.size();
  ClickLinearization out{px - click.px, Eigen::MatrixXd::Zero(2, columns.back()), Eigen::MatrixXd::Zero(2, p + 6)};
  const Eigen::Matrix<double, 2, 3> d_rig = d.d_px_d_x_in_cam * cam_from_rig.rotation.toRotationMatrix();
  out.by_unknowns.leftCols<3>() = -d_rig * geometry::CrossMatrix(rotated);
  out.by_unknowns.middleCols<3>(3) = d_rig;
  for (int k = 0; k < d.count; ++k) out.by_given.col(d.columns[static_cast<size_t>(k)]) += d.d_px.col(k);
  out.by_given.middleCols<3>(p) = -d.d_px_d_x_in_cam * geometry::CrossMatrix(rotated_in_cam);
  out.by_given.middleCols<3>(p + 3) = d.d_px_d_x_in_cam;
  if (directions.cols() > 0) out.by_unknowns.middleCols(columns[c], directions.cols()) = out.by_given.leftCols(p) * directions;
  return out;
}

/// (X, N) mixed part of the normal equations: unknowns by what is given.
Eigen::MatrixXd MixedNormal(const ResectionProblem& problem, const std::vector<bool>& used) {
  const std::vector<Eigen::Index> columns = LensColumns(problem);
  std::vector<Eigen::Index> begin = {0};
  for (const geometry::Camera& camera : problem.cameras) begin.push_back(begin.back() + camera.params.size() + 6);
  Eigen::MatrixXd mixed = Eigen::MatrixXd::Zero(columns.back(), begin.back());
  for (size_t i = 0; i < problem.clicks.size(); ++i) {
    const auto click = used[i] ? LinearizeClick(problem, problem.clicks[i], columns) : std::nullopt;
    if (!click) continue;
    const Eigen::Index first = begin[static_cast<size_t>(problem.clicks[i].camera_idx)];
    mixed.middleCols(first, click->by_given.cols()) += click->by_unknowns.transpose() * click->by_given;
  }
  return mixed;
}

ResectionProblem Moved(const ResectionProblem& problem, const Eigen::VectorXd& step) {
  ResectionProblem moved = problem;
  moved.rig_from_world = geometry::Perturb(step.head<6>(), problem.rig_from_world);
  Eigen::Index column = 6;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const Eigen::MatrixXd& d = problem.directions[c];
    if (d.cols() > 0) moved.cameras[c].params += d * step.segment(column, d.cols());
    column += d.cols();
  }
  return moved;
}

struct ClickProblem : geometry::LeastSquaresProblem<Eigen::Dynamic, ResectionProblem> {
  const std::vector<bool>& used;

  explicit ClickProblem(const std::vector<bool>& clicks) : used(clicks) {}
  ResectionProblem Retract(const ResectionProblem& from, const Eigen::VectorXd& step) const { return Moved(from, step); }

  bool Linearize(const ResectionProblem& at, Normal* out) const {
    const std::vector<Eigen::Index> columns = LensColumns(at);
    out->h.setZero(columns.back(), columns.back()), out->g.setZero(columns.back());
    for (size_t i = 0; i < at.clicks.size(); ++i) {
      if (!used[i]) continue;
      const auto click = LinearizeClick(at, at.clicks[i], columns);
      if (!click) return false;
      out->cost += click->residual.squaredNorm();
      out->h += click->by_unknowns.transpose() * click->by_unknowns;
      out->g += click->by_unknowns.transpose() * click->residual;
    }
    return true;
  }

  /// By the decrease of the cost that the step promises.
  geometry::StepVerdict Judge(const geometry::LeastSquaresOptions&, const Eigen::VectorXd& step, const Normal& at,
                              const Normal* trial) const {
    const double predicted = -at.g.dot(step);
    if (predicted <= 1e-14 * at.cost + 1e-24) return geometry::StepVerdict::kRest;
    if (trial && trial->cost < at.cost) return geometry::StepVerdict::kTake;
    return predicted <= 1e-10 * at.cost ? geometry::StepVerdict::kRest : geometry::StepVerdict::kRefuse;
  }
};

/// Over the used clicks; false when it does not converge.
bool Refine(const std::vector<bool>& used, ResectionProblem* problem, Normal* at_end) {
  geometry::LeastSquaresOptions options;
  options.max_iterations = 100;
  options.least_damping = 1e-12, options.max_damping = 1e12;
  auto end = geometry::SolveLeastSquares(ClickProblem(used), *problem, options);
  *problem = std::move(end.state), *at_end = std::move(end.equations);
  return end.status == Status::kOk;
}

std::vector<bool> Within(const ResectionProblem& problem, double limit_px) {
  const Eigen::Matrix2Xd residuals = ResectionResiduals(problem);
  std::vector<bool> within;
  for (Eigen::Index i = 0; i < residuals.cols(); ++i) within.push_back(residuals.col(i).norm() <= limit_px);
  return within;
}

int Count(const std::vector<bool>& flags) { return static_cast<int>(std::count(flags.begin(), flags.end(), true)); }

/// Adjusts and rejects in turn until the kept clicks stay the same.
bool FitRobustly(double click_sigma_px, double middle_px, ResectionProblem* problem, std::vector<bool>* used, Normal* normal) {
  constexpr double kFarInSigmas = 4.5;
  // A minimal pose errs at the other clicks by more than a click does.
  *used = Within(*problem, std::max(3 * middle_px, 3 * kFarInSigmas * click_sigma_px));
  for (int round = 0; round < 10; ++round) {
    if (Count(*used) < 4 || !Refine(*used, problem, normal)) return false;
    const int freedom = 2 * Count(*used) - static_cast<int>(normal->g.size());
    const double estimated = freedom > 0 ? std::sqrt(normal->cost / freedom) : 0;
    const double sigma = std::max(click_sigma_px, std::min(estimated, 3 * click_sigma_px));
    const std::vector<bool> next = Within(*problem, kFarInSigmas * sigma);
    if (next == *used || Count(next) < 4) return true;
    *used = next;
  }
  return true;
}

/// Errors of the used clicks when each is left out of the fit.
std::vector<double> LeaveOneOut(const ResectionProblem& problem, const std::vector<bool>& used) {
  std::vector<double> errors;
  for (size_t i = 0; i < used.size(); ++i) {
    if (!used[i]) continue;
    std::vector<bool> others = used;
    others[i] = false;
    ResectionProblem fit = problem;
    Normal normal;
    const bool ok = Refine(others, &fit, &normal);
    errors.push_back(ok ? ResectionResiduals(fit).col(static_cast<Eigen::Index>(i)).norm() : kInfinity);
  }
  return errors;
}

/// Extent of the points that were clicked along their principal axes, largest first.
Eigen::Vector3d Extents(const ResectionProblem& problem, const std::vector<bool>& used) {
  std::vector<int> points;
  for (size_t i = 0; i < used.size(); ++i) {
    if (used[i]) points.push_back(problem.clicks[i].point_idx);
  }
  Eigen::Matrix3Xd x(3, static_cast<Eigen::Index>(points.size()));
  for (size_t i = 0; i < points.size(); ++i) x.col(static_cast<Eigen::Index>(i)) = problem.x_in_world.col(points[i]);
  x.colwise() -= Eigen::Vector3d(x.rowwise().mean());
  Eigen::Vector3d extents = Eigen::Vector3d::Zero();
  const Eigen::VectorXd values = geometry::SingularValues(x);
  extents.head(values.size()) = values;
  return extents;
}

/// Frees the focal length, then k1, as long as leave-one-out errors show that it pays.
std::string RefineLens(const std::vector<bool>& used, std::vector<double>* errors, ResectionProblem* problem, Normal* normal) {
  const Eigen::Vector3d extents = Extents(*problem, used);
  if (problem->cameras.size() > 1) return "lenses of a rigid group are kept";
  if (extents[2] < 0.05 * extents[0]) return "lens kept: the points are nearly coplanar, which does not fix a focal length";
  std::string reason = "lens kept: left-out points get no better with the focal length free";
  geometry::Camera& camera = problem->cameras[0];
  for (int distortion = 0; distortion <= 1; ++distortion) {
    ResectionProblem candidate = *problem;
    if (distortion == 1 && camera.model == geometry::LensModel::kPinhole) {
      candidate.cameras[0].model = geometry::LensModel::kBrown1;
      candidate.cameras[0].params.conservativeResizeLike(Eigen::VectorXd::Zero(5));
    }
    if (camera.model == geometry::LensModel::kSplined) return "lens kept: it is a splined one";
    const bool has_k1 = distortion == 0 || geometry::ParamNames(candidate.cameras[0].model).at(4) == "k1";
    if (Count(used) < 8 + 2 * distortion || !has_k1) break;
    candidate.directions[0] = FocalDirections(candidate.cameras[0], distortion);
    Normal fit;
    if (!Refine(used, &candidate, &fit)) break;
    const std::vector<double> left_out = LeaveOneOut(candidate, used);
    if (!(Rms(left_out) < 0.9 * Rms(*errors))) break;
    *problem = candidate, *normal = fit, *errors = left_out;
    reason = distortion == 0 ? "focal length refined: left-out points are better for it"
                             : "focal length and k1 refined: left-out points are better for it";
  }
  return reason;
}

PointResection Refuse(Status status, const std::string& message, size_t num_clicks) {
  PointResection out;
  out.status = status, out.message = message;
  out.residuals_px = Eigen::Matrix2Xd::Constant(2, static_cast<Eigen::Index>(num_clicks), kInfinity);
  out.rejected.assign(num_clicks, false);
  return out;
}

int DistinctPoints(const std::vector<PointClick>& clicks) {
  std::vector<int> ids;
  for (const PointClick& click : clicks) ids.push_back(click.point_idx);
  std::sort(ids.begin(), ids.end());
  return static_cast<int>(std::unique(ids.begin(), ids.end()) - ids.begin());
}

void FillCovariance(const ResectionProblem& problem, const std::vector<bool>& used, const Normal& normal, double sigma_px,
                    PointResection* out) {
  const Eigen::MatrixXd inverse = geometry::ScaledInverse(normal.h), covariance = sigma_px * sigma_px * inverse;
  out->unknowns_covariance = covariance, out->unknowns_by_given = -inverse * MixedNormal(problem, used);
  out->lens_directions = problem.directions;
  out->covariance = covariance.topLeftCorner<6, 6>();
  out->params_covariance.resize(problem.cameras.size());
  Eigen::Index column = 6;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const Eigen::MatrixXd& d = problem.directions[c];
    if (d.cols() > 0) out->params_covariance[c] = d * covariance.block(column, column, d.cols(), d.cols()) * d.transpose();
    column += d.cols();
  }
}

/// Whether the largest standard deviation of the centre is small beside the distance of the nearest used point.
bool IsDetermined(const ResectionProblem& problem, const std::vector<bool>& used, const PointResection& out) {
  if (!out.covariance.allFinite()) return false;
  double nearest = kInfinity;
  for (size_t i = 0; i < used.size(); ++i) {
    if (!used[i]) continue;
    const auto c = static_cast<size_t>(problem.clicks[i].camera_idx);
    const Eigen::Vector3d x_in_rig =
        problem.rig_from_world * Eigen::Vector3d(problem.x_in_world.col(problem.clicks[i].point_idx));
    nearest = std::min(nearest, (problem.cam_from_rig[c] * x_in_rig).norm());
  }
  // Rotations of the whole group about world's origin move the centre: c = -R^T t.
  Eigen::Matrix<double, 3, 6> j;
  const Eigen::Matrix3d world_r_rig = problem.rig_from_world.rotation.toRotationMatrix().transpose();
  j << -world_r_rig * geometry::CrossMatrix(problem.rig_from_world.translation), -world_r_rig;
  const Eigen::Matrix3d centre = j * out.covariance * j.transpose();
  const double worst = std::sqrt(std::max(0.0, geometry::SymmetricEigenvalues(centre)[2]));
  return worst <= 0.25 * nearest;
}

/// ResectFromPoints for points about the origin.
PointResection ResectNear(const std::vector<geometry::RigCamera>& rig, const std::vector<PointClick>& clicks,
                          const Eigen::Matrix3Xd& x_in_world, const PointResectionOptions& options) {
  MVS_CHECK(!rig.empty(), "no camera");
  MVS_CHECK(options.click_sigma_px > 0, "click_sigma_px = " << options.click_sigma_px);
  const int distinct = DistinctPoints(clicks);
  if (distinct < 4)
    return Refuse(Status::kTooFewViews, std::to_string(distinct) + " points are marked; at least 4 are needed", clicks.size());
  ResectionProblem problem{clicks, x_in_world, {}, {}, {}, {}};
  for (const geometry::RigCamera& camera : rig) {
    problem.cam_from_rig.push_back(camera.cam_from_world);
    problem.cameras.push_back(camera.camera);
    problem.directions.push_back(FixedLens(camera.camera));
  }
  const std::vector<bool> all(clicks.size(), true);
  const Eigen::Vector3d extents = Extents(problem, all);
  if (!(extents[1] > 1e-3 * extents[0])) return Refuse(Status::kDegenerate, "the marked points lie on one line", clicks.size());
  double middle_px = 0;
  std::vector<bool> used;
  Normal normal;
  if (!FindResectionStart(&problem, &middle_px))
    return Refuse(Status::kDegenerate, "no pose of the camera fits the marked points", clicks.size());
  if (!FitRobustly(options.click_sigma_px, middle_px, &problem, &used, &normal))
    return Refuse(Status::kNotConverged, "the pose could not be fitted to the marked points: too many of them disagree",
                  clicks.size());
  if (2 * Count(used) <= static_cast<int>(clicks.size()))
    return Refuse(Status::kNotConverged,
                  "most marked points disagree with each other: check their numbering and the intrinsics", clicks.size());
  PointResection out;
  std::vector<double> errors = LeaveOneOut(problem, used);
  if (options.refine_lens) out.lens_reason = RefineLens(used, &errors, &problem, &normal);
  out.num_used = Count(used);
  out.leave_one_out_px = out.num_used >= 5 ? Rms(errors) : std::numeric_limits<double>::quiet_NaN();
  out.rig_from_world = problem.rig_from_world;
  out.cameras = problem.cameras;
  out.residuals_px = ResectionResiduals(problem);
  for (const bool u : used) out.rejected.push_back(!u);
  out.rms_px = std::sqrt(normal.cost / out.num_used);
  const int freedom = 2 * out.num_used - static_cast<int>(normal.g.size());
  constexpr int kEnoughToEstimate = 20;
  const double estimated = freedom > 0 ? std::sqrt(normal.cost / freedom) : 0;
  out.sigma_px = freedom >= kEnoughToEstimate ? estimated : std::max(estimated, options.click_sigma_px);
  FillCovariance(problem, used, normal, out.sigma_px, &out);
  if (!IsDetermined(problem, used, out)) {
    out.status = Status::kDegenerate;
    out.message =
        "the marked points leave the camera's place uncertain by more than a quarter of its distance: mark points farther "
        "apart, not on one line";
  }
  return out;
}

/// The same for a world whose origin lies `shift` before the solved one: a left perturbation of the rotation then moves the
/// translation, too.
void MoveOrigin(const Eigen::Vector3d& shift, PointResection* out) {
  const Eigen::Vector3d rotated = out->rig_from_world.rotation * shift;
  out->rig_from_world.translation -= rotated;
  Eigen::Matrix<double, 6, 6> moved_by_solved = Eigen::Matrix<double, 6, 6>::Identity();
  moved_by_solved.bottomLeftCorner<3, 3>() = geometry::CrossMatrix(rotated);
  out->covariance = moved_by_solved * out->covariance * moved_by_solved.transpose();
  if (out->unknowns_covariance.rows() < 6) return;
  out->unknowns_covariance.topRows<6>() = (moved_by_solved * out->unknowns_covariance.topRows<6>()).eval();
  out->unknowns_covariance.leftCols<6>() = (out->unknowns_covariance.leftCols<6>() * moved_by_solved.transpose()).eval();
  out->unknowns_by_given.topRows<6>() = (moved_by_solved * out->unknowns_by_given.topRows<6>()).eval();
}

/// Mean of the clicked points; the origin where there are none.
Eigen::Vector3d MiddleOf(const std::vector<PointClick>& clicks, const Eigen::Matrix3Xd& x_in_world) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const PointClick& click : clicks) sum += x_in_world.col(click.point_idx) / static_cast<double>(clicks.size());
  return sum;
}

}  // namespace

PointResection ResectFromPoints(const std::vector<geometry::RigCamera>& rig, const std::vector<PointClick>& clicks,
                                const Eigen::Matrix3Xd& x_in_world, const PointResectionOptions& options) {
  const Eigen::Vector3d middle = MiddleOf(clicks, x_in_world);  // map coordinates are millions of metres
  PointResection out = ResectNear(rig, clicks, x_in_world.colwise() - middle, options);
  if (out.num_used > 0) MoveOrigin(middle, &out);
  return out;
}

}  // namespace mvstudio::calib
