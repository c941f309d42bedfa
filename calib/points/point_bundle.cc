#include "calib/points/point_bundle.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/covariance/held_covariance.h"
#include "calib/points/point_problem.h"
#include "core/check.h"
#include "core/statistics.h"
#include "geometry/lens/lens_derivatives.h"

namespace mvstudio::calib {
namespace {

constexpr double kCauchyToSigma = 2.0;

bool IsFixed(const std::vector<bool>& fixed, size_t i) { return i < fixed.size() && fixed[i]; }

int NumUnknowns(const PointScene& scene, const std::vector<PointObservation>& observations, const PointBundleOptions& options) {
  int unknowns = 0;
  for (const Eigen::MatrixXd& directions : options.lens_directions) unknowns += static_cast<int>(directions.cols());
  for (size_t c = 0; c < scene.cam_from_world.size(); ++c) unknowns += IsFixed(options.fix_camera, c) ? 0 : 6;
  std::vector<bool> seen(static_cast<size_t>(scene.points.cols()), false);
  for (const PointObservation& o : observations)
    seen[static_cast<size_t>(o.point_idx)] = seen[static_cast<size_t>(o.point_idx)] || o.weight > 0;
  for (size_t p = 0; p < seen.size(); ++p) unknowns += seen[p] && !IsFixed(options.fix_point, p) ? 3 : 0;
  return unknowns;
}

/// Rejects what does not project; then points that keep fewer than 2 observations. Returns how many were rejected.
void DropUnusable(const PointScene& scene, const PointBundleOptions& options, std::vector<PointObservation>* observations) {
  const Eigen::Matrix2Xd residuals = PointResiduals(scene, *observations);
  std::vector<int> kept(static_cast<size_t>(scene.points.cols()), 0);
  for (size_t i = 0; i < observations->size(); ++i) {
    PointObservation& o = (*observations)[i];
    if (!residuals.col(static_cast<Eigen::Index>(i)).allFinite()) o.weight = 0;
    kept[static_cast<size_t>(o.point_idx)] += o.weight > 0;
  }
  for (PointObservation& o : *observations) {
    if (kept[static_cast<size_t>(o.point_idx)] < 2 && !IsFixed(options.fix_point, static_cast<size_t>(o.point_idx)))
      o.weight = 0;
  }
}

/// Robust standard deviation per coordinate of the weighted residuals: the median length of a 2-D normal vector is 1.1774
/// sigma.
double RobustSigma(const PointScene& scene, const std::vector<PointObservation>& observations) {
  const Eigen::Matrix2Xd residuals = PointResiduals(scene, observations);
  std::vector<double> lengths;
  for (size_t i = 0; i < observations.size(); ++i) {
    if (observations[i].weight > 0)
      lengths.push_back(std::sqrt(observations[i].weight) * residuals.col(static_cast<Eigen::Index>(i)).norm());
  }
  return UpperMedian(lengths, 0) / 1.1774;
}

SchurLmReport Adjust(PointScene* scene, const std::vector<PointObservation>& observations, const PointBundleOptions& options,
                     double robust_px, double tolerance, double* start_cost) {
  PointProblem problem(*scene, observations, options, PointProblem::ChooseBlocks(*scene, options), robust_px);
  SchurSystem system;
  problem.AllocateSystem(&system);
  if (start_cost) {
    problem.Try(Eigen::VectorXd::Zero(system.g.size()), Eigen::MatrixXd::Zero(system.block_dim(), system.num_blocks()));
    *start_cost = problem.LinearizeTrial(&system) ? system.cost : NAN;
  }
  SchurLmOptions lm;
  lm.max_iterations = options.max_iterations;
  lm.cost_tolerance = tolerance;
  lm.negligible_cost = 1e-24 * static_cast<double>(observations.size());
  lm.num_threads = options.num_threads;
  const SchurLmReport report = SolveSchurLm(&problem, &system, lm);
  *scene = problem.scene();
  return report;
}

/// Rejects observations beyond the limit and takes back those within it; true when something changed.
bool Reject(const PointScene& scene, const PointBundleOptions& options, const std::vector<double>& weights,
            std::vector<PointObservation>* observations) {
  const double limit = options.reject_sigmas * std::max({RobustSigma(scene, *observations), options.min_sigma, 1e-9});
  const Eigen::Matrix2Xd residuals = PointResiduals(scene, *observations);
  std::vector<double> before;
  for (size_t i = 0; i < observations->size(); ++i) {
    PointObservation& o = (*observations)[i];
    before.push_back(o.weight);
    const double worst = std::sqrt(weights[i]) * residuals.col(static_cast<Eigen::Index>(i)).cwiseAbs().maxCoeff();
    o.weight = worst <= limit ? weights[i] : 0;
  }
  DropUnusable(scene, options, observations);
  bool changed = false;
  for (size_t i = 0; i < before.size(); ++i) changed |= before[i] != (*observations)[i].weight;
  return changed;
}

bool IsFinite(const PointScene& scene, const std::vector<PointObservation>& observations) {
  bool finite = scene.points.allFinite();
  for (const auto& lens : scene.lenses) finite &= lens.params.allFinite();
  for (const auto& pose : scene.cam_from_world) finite &= pose.translation.allFinite() && pose.rotation.coeffs().allFinite();
  for (const PointObservation& o : observations) finite &= o.px.allFinite() && std::isfinite(o.weight);
  return finite;
}

void Summarise(const PointScene& scene, const std::vector<PointObservation>& observations, const PointBundleOptions& options,
               PointBundleReport* report) {
  const Eigen::Matrix2Xd residuals = PointResiduals(scene, observations);
  double squares = 0, weighted = 0;
  report->num_observations = 0;
  for (size_t i = 0; i < observations.size(); ++i) {
    if (!(observations[i].weight > 0)) continue;
    const double square = residuals.col(static_cast<Eigen::Index>(i)).squaredNorm();
    squares += square, weighted += observations[i].weight * square;
    ++report->num_observations;
  }
  const int freedom = 2 * report->num_observations - NumUnknowns(scene, observations, options);
  report->cost = weighted;
  report->rms_px = report->num_observations > 0 ? std::sqrt(squares / report->num_observations) : 0;
  report->sigma_px = freedom > 0 ? std::sqrt(weighted / freedom) : 0;
}

/// Normal equations of lenses and cameras, the points eliminated, and what takes their diagonal with the points to 1; false
/// where an observation does not project.
bool NormalEquations(const PointScene& scene, const std::vector<PointObservation>& observations,
                     const PointBundleOptions& options, Eigen::MatrixXd* h, Eigen::VectorXd* scale) {
  PointProblem problem(scene, observations, options, PointProblem::Blocks::kPoints, 0);
  SchurSystem system;
  problem.AllocateSystem(&system);
  problem.Try(Eigen::VectorXd::Zero(system.g.size()), Eigen::MatrixXd::Zero(3, system.num_blocks()));
  *h = Eigen::MatrixXd::Zero(system.g.size(), system.g.size());
  if (!problem.LinearizeTrial(&system)) return false;
  *h = Reduce(system, 0, options.num_threads).h.selfadjointView<Eigen::Lower>();
  *scale = system.h.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  return true;
}

/// Which columns are lenses that were held, and their covariance.
struct HeldColumns {
  std::vector<Eigen::Index> estimated, held;
  Eigen::MatrixXd covariance;
};

HeldColumns ColumnsOfHeld(const PointScene& scene, const PointProblem& layout,
                          const std::vector<std::optional<Eigen::MatrixXd>>& held_lens) {
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(layout.num_global(), layout.num_global());
  std::vector<bool> is_held(static_cast<size_t>(layout.num_global()), false);
  for (size_t l = 0; l < std::min(held_lens.size(), scene.lenses.size()); ++l) {
    const int column = layout.lens_column(static_cast<int>(l));
    if (!held_lens[l] || column < 0) continue;
    const Eigen::Index p = held_lens[l]->rows();
    all.block(column, column, p, p) = *held_lens[l];
    std::fill_n(is_held.begin() + column, p, true);
  }
  HeldColumns out;
  for (size_t i = 0; i < is_held.size(); ++i) (is_held[i] ? out.held : out.estimated).push_back(static_cast<Eigen::Index>(i));
  out.covariance = all(out.held, out.held);
  return out;
}

/// Blocks and joint covariance from that of the problem's columns.
PointBundleCovariance Spread(const PointScene& scene, const PointProblem& layout, const Eigen::MatrixXd& covariance,
                             PointBundleCovariance out) {
  for (size_t l = 0; l < scene.lenses.size(); ++l) {
    const int column = layout.lens_column(static_cast<int>(l));
    const Eigen::MatrixXd& d = layout.directions(static_cast<int>(l));
    out.lens.push_back(Eigen::MatrixXd::Zero(d.rows(), d.rows()));
    if (column >= 0) out.lens[l] = d * covariance.block(column, column, d.cols(), d.cols()) * d.transpose();
  }
  Eigen::Index rows = 0;
  for (size_t c = 0; c < scene.cam_from_world.size(); ++c) rows += scene.LensOf(static_cast<int>(c)).params.size() + 6;
  Eigen::MatrixXd by_columns = Eigen::MatrixXd::Zero(rows, covariance.rows());
  Eigen::Index row = 0;
  for (size_t c = 0; c < scene.cam_from_world.size(); ++c) {
    const int lens = scene.lens_of_camera[c], lens_column = layout.lens_column(lens),
              pose = layout.camera_column(static_cast<int>(c));
    const Eigen::MatrixXd& d = layout.directions(lens);
    const Eigen::Index p = scene.LensOf(static_cast<int>(c)).params.size();
    if (lens_column >= 0) by_columns.block(row, lens_column, p, d.cols()) = d;
    if (pose >= 0) by_columns.block<6, 6>(row + p, pose).setIdentity();
    row += p + 6;
    out.cam_from_world.push_back(Eigen::Matrix<double, 6, 6>::Zero());
    if (pose >= 0) out.cam_from_world[c] = covariance.block<6, 6>(pose, pose);
  }
  out.joint = by_columns * covariance * by_columns.transpose();
  return out;
}

}  // namespace

Eigen::MatrixXd FixedLens(const geometry::Camera& lens) { return Eigen::MatrixXd(lens.params.size(), 0); }

Eigen::MatrixXd FocalDirections(const geometry::Camera& lens, int num_distortion) {
  MVS_CHECK(num_distortion >= 0 && 4 + num_distortion <= lens.params.size(), num_distortion << " distortion parameters");
  Eigen::MatrixXd directions = Eigen::MatrixXd::Zero(lens.params.size(), 1 + num_distortion);
  directions(0, 0) = 1;
  directions(1, 0) = lens.fy() / lens.fx();
  for (int i = 0; i < num_distortion; ++i) directions(4 + i, 1 + i) = 1;
  return directions;
}

Eigen::MatrixXd AllDirections(const geometry::Camera& lens) {
  return Eigen::MatrixXd::Identity(lens.params.size(), lens.params.size());
}

Eigen::Matrix2Xd PointResiduals(const PointScene& scene, const std::vector<PointObservation>& observations) {
  Eigen::Matrix2Xd residuals(2, static_cast<Eigen::Index>(observations.size()));
  for (size_t i = 0; i < observations.size(); ++i) {
    const PointObservation& o = observations[i];
    const Eigen::Vector3d x_in_cam =
        scene.cam_from_world[static_cast<size_t>(o.camera_idx)] * Eigen::Vector3d(scene.points.col(o.point_idx));
    Eigen::Vector2d px;
    if (geometry::ProjectLens(scene.LensOf(o.camera_idx), x_in_cam, &px, nullptr)) {
      residuals.col(static_cast<Eigen::Index>(i)) = px - o.px;
    } else {
      residuals.col(static_cast<Eigen::Index>(i)).setConstant(std::numeric_limits<double>::infinity());
    }
  }
  return residuals;
}

PointBundleReport SolvePointBundle(PointScene* scene, std::vector<PointObservation>* observations,
                                   const PointBundleOptions& options) {
  MVS_CHECK(scene->lens_of_camera.size() == scene->cam_from_world.size(), "a lens for each camera");
  PointBundleReport report;
  if (!IsFinite(*scene, *observations))
    return report.status = Status::kNonFiniteInput, report.message = "a number is not finite", report;
  std::vector<double> weights;
  for (const PointObservation& o : *observations) weights.push_back(o.weight);
  DropUnusable(*scene, options, observations);
  const int usable =
      static_cast<int>(std::count_if(observations->begin(), observations->end(), [](const auto& o) { return o.weight > 0; }));
  if (2 * usable < NumUnknowns(*scene, *observations, options) || usable == 0) {
    report.status = Status::kTooFewViews;
    report.message = std::to_string(usable) + " observations are too few for " +
                     std::to_string(NumUnknowns(*scene, *observations, options)) + " unknowns";
    return report;
  }
  SchurLmReport lm;
  if (options.reject_outliers) {
    const double robust = options.robust_px > 0
                              ? options.robust_px
                              : kCauchyToSigma * std::max({RobustSigma(*scene, *observations), options.min_sigma, 0.1});
    lm = Adjust(scene, *observations, options, robust, std::max(1e-6, options.cost_tolerance), nullptr);
    report.num_iterations += lm.num_iterations;
    Reject(*scene, options, weights, observations);
  }
  constexpr int kMaxRounds = 5;
  for (int round = 0; round < kMaxRounds; ++round) {
    lm = Adjust(scene, *observations, options, 0, options.cost_tolerance, round == 0 ? &report.start_cost : nullptr);
    report.num_iterations += lm.num_iterations;
    if (!options.reject_outliers || !Reject(*scene, options, weights, observations)) break;
  }
  Summarise(*scene, *observations, options, &report);
  for (size_t i = 0; i < weights.size(); ++i) report.num_rejected += weights[i] > 0 && !((*observations)[i].weight > 0);
  report.status = lm.status;
  if (lm.status == Status::kUndefined) report.message = "a residual has no value at the start";
  if (lm.status == Status::kNotConverged)
    report.message = "the adjustment ended after " + std::to_string(report.num_iterations) + " steps without converging";
  return report;
}

PointBundleCovariance CovarianceOfPointBundle(const PointScene& scene, const std::vector<PointObservation>& observations,
                                              const PointBundleOptions& options, double sigma_px,
                                              const std::vector<std::optional<Eigen::MatrixXd>>& held_lens) {
  PointBundleOptions freed = options;
  if (freed.distance) freed.distance->sigma /= sigma_px;  // a length: sigma_px^2 below is not meant for it
  for (size_t l = freed.lens_directions.size(); l < scene.lenses.size(); ++l)
    freed.lens_directions.push_back(FixedLens(scene.lenses[l]));
  for (size_t l = 0; l < held_lens.size(); ++l) {
    if (held_lens[l]) freed.lens_directions[l] = AllDirections(scene.lenses[l]);
  }
  const PointProblem layout(scene, observations, freed, PointProblem::Blocks::kPoints, 0);
  PointBundleCovariance out;
  Eigen::MatrixXd h;
  Eigen::VectorXd scale;
  if (!NormalEquations(scene, observations, freed, &h, &scale)) {
    out.status = Status::kDegenerate, out.message = "an observation does not project at the solution";
    return Spread(scene, layout, Eigen::MatrixXd::Zero(h.rows(), h.cols()), out);
  }
  const HeldColumns held = ColumnsOfHeld(scene, layout, held_lens);
  const Eigen::VectorXd unit = scale(held.estimated);
  const Eigen::MatrixXd own = unit.asDiagonal() * h(held.estimated, held.estimated) * unit.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(own);
  constexpr double kSmallest = 1e-12;  // of the normal equations with unit diagonal: rounding is 1e-16 times their size
  if (own.rows() > 0 && !(eigen.eigenvalues()[0] > kSmallest)) {
    out.status = Status::kDegenerate;
    out.message = "the observations do not determine all camera poses and lenses";
    return Spread(scene, layout, Eigen::MatrixXd::Zero(h.rows(), h.cols()), out);
  }
  const Eigen::MatrixXd inverse = unit.asDiagonal() * eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() *
                                  eigen.eigenvectors().transpose() * unit.asDiagonal();
  return Spread(scene, layout,
                CovarianceWithHeld(h, held.estimated, held.held, inverse, sigma_px * sigma_px * inverse, held.covariance), out);
}

}  // namespace mvstudio::calib
