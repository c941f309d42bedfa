#include "triangulate/sync/offset_sigma.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "core/statistics.h"
#include "triangulate/point/calibration_covariance.h"
#include "triangulate/point/noise.h"

namespace mvstudio::triangulate::internal {
namespace {

constexpr int kMaxLag = 24;  // tracks' windows reach over 9 frames

/// A view of a point, by its index among the points and the view's among its views.
struct SeriesItem {
  const TimedPoint* point;
  const PointEquations* equations;
  size_t view;
};

/// What one camera saw of one joint, by time.
using Series = std::vector<SeriesItem>;

std::vector<std::optional<PointEquations>> AllEquations(const std::vector<TimedPoint>& points) {
  std::vector<std::optional<PointEquations>> all;
  all.reserve(points.size());
  for (const TimedPoint& point : points) all.push_back(EquationsOf(point));
  return all;
}

std::vector<Series> MakeSeries(const std::vector<TimedPoint>& points,
                               const std::vector<std::optional<PointEquations>>& equations) {
  std::map<std::tuple<size_t, size_t, size_t>, Series> series;
  for (size_t i = 0; i < points.size(); ++i) {
    if (!equations[i]) continue;
    for (size_t v = 0; v < points[i].views.size(); ++v) {
      series[{points[i].views[v].camera_idx, points[i].person_idx, points[i].joint_idx}].push_back(
          {&points[i], &*equations[i], v});
    }
  }
  std::vector<Series> all;
  for (auto& each : series) all.push_back(std::move(each.second));
  return all;
}

/// Standard deviation of a coordinate from squared residuals of points whose three coordinates were fitted to them.
double SigmaOf(const std::vector<TimedPoint>& points, const std::vector<std::optional<PointEquations>>& equations) {
  std::vector<double> ratios;
  for (size_t i = 0; i < points.size(); ++i) {
    if (!equations[i]) continue;
    double sum = 0;
    for (const Eigen::Vector2d& px : equations[i]->px) sum += px.squaredNorm();
    ratios.push_back(sum / ChiSquaredMedian(2 * static_cast<int>(points[i].views.size()) - 3));
  }
  return ratios.empty() ? 0 : std::sqrt(UpperMedian(std::move(ratios)));
}

/// The same of the slopes: a point's three velocities are fitted to those of its views.
double SlopeSigmaOf(const std::vector<TimedPoint>& points, const std::vector<std::optional<PointEquations>>& equations) {
  std::vector<double> ratios;
  for (size_t i = 0; i < points.size(); ++i) {
    if (!equations[i]) continue;
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    const std::vector<TimedView>& views = points[i].views;
    for (size_t v = 0; v < views.size(); ++v)
      right += views[v].weight * equations[i]->by_x[v].transpose() * views[v].px_per_frame;
    const Eigen::Vector3d velocity = equations[i]->x_covariance * right;
    double sum = 0;
    for (size_t v = 0; v < views.size(); ++v) sum += (views[v].px_per_frame - equations[i]->by_x[v] * velocity).squaredNorm();
    ratios.push_back(sum / ChiSquaredMedian(2 * static_cast<int>(views.size()) - 3));
  }
  return ratios.empty() ? 0 : std::sqrt(UpperMedian(std::move(ratios)));
}

/// 1 up to half of the longest lag, then down to 0 (Politis and Romano, "Bias-corrected nonparametric spectral estimation",
/// 1995).
double Taper(int lag) { return std::clamp(2 - 2.0 * lag / kMaxLag, 0.0, 1.0); }

std::vector<double> CorrelationOf(const std::vector<Series>& series) {
  std::vector<double> sums(kMaxLag, 0), weights(kMaxLag, 0);
  for (const Series& each : series) {
    for (size_t i = 0; i < each.size(); ++i) {
      for (size_t k = i; k < each.size() && each[k].point->index - each[i].point->index < kMaxLag; ++k) {
        const size_t lag = static_cast<size_t>(each[k].point->index - each[i].point->index);
        const double weight = each[i].point->views[each[i].view].weight * each[k].point->views[each[k].view].weight;
        sums[lag] += weight * each[i].equations->px[each[i].view].dot(each[k].equations->px[each[k].view]);
        weights[lag] += weight;
      }
    }
  }
  std::vector<double> correlation(kMaxLag, 0);
  if (!(sums[0] > 0)) return {1};
  for (int lag = 0; lag < kMaxLag; ++lag) {
    const size_t k = static_cast<size_t>(lag);
    if (weights[k] > 0) correlation[k] = Taper(lag) * sums[k] / weights[k] / (sums[0] / weights[0]);
  }
  return correlation;
}

/// How a view's noise moves the unknowns of `rows`.  // (rows, 2)
Eigen::MatrixX2d Influence(const SeriesItem& item, const Eigen::MatrixXd& rows) {
  const PointEquations& equations = *item.equations;
  const std::vector<TimedView>& views = item.point->views;
  Eigen::MatrixX2d influence = Eigen::MatrixX2d::Zero(rows.rows(), 2);
  const Eigen::Matrix<double, 3, 2> x =
      equations.x_covariance * views[item.view].weight * equations.by_x[item.view].transpose();
  for (size_t v = 0; v < views.size(); ++v) {
    Eigen::Matrix2d seen = -equations.by_x[v] * x;
    if (v == item.view) seen += Eigen::Matrix2d::Identity();
    const Eigen::Matrix<double, kClockParams, 2> gradient = views[v].weight * equations.by_clock[v].transpose() * seen;
    influence.noalias() +=
        rows.middleCols<kClockParams>(kClockParams * static_cast<Eigen::Index>(views[v].camera_idx)) * gradient;
  }
  return influence;
}

/// Variance of the unknowns of `rows` by noise of variance 1 in the samples of one series.
Eigen::VectorXd SeriesVariance(const Series& series, const std::vector<double>& correlation, const Eigen::MatrixXd& rows) {
  std::vector<Eigen::MatrixX2d> influences;
  for (const SeriesItem& item : series) influences.push_back(Influence(item, rows));
  Eigen::VectorXd variance = Eigen::VectorXd::Zero(rows.rows());
  Eigen::MatrixX2d together(rows.rows(), 2);
  for (size_t i = 0; i < series.size(); ++i) {
    together = influences[i];
    for (size_t k = i + 1; k < series.size(); ++k) {
      const size_t lag = static_cast<size_t>(series[k].point->index - series[i].point->index);
      if (lag >= correlation.size()) break;
      together += 2 * correlation[lag] * influences[k];
    }
    variance += influences[i].cwiseProduct(together).rowwise().sum();
  }
  return variance;
}

/// Variance of the unknowns of `rows` by the rig's covariance: its error is the same in every frame.
Eigen::VectorXd CalibrationVariance(const PreparedRig& rig, const std::vector<Series>& series, const Eigen::MatrixXd& rows) {
  if (rig.covariance.size() == 0) return Eigen::VectorXd::Zero(rows.rows());
  Eigen::MatrixXd moved = Eigen::MatrixXd::Zero(rows.rows(), rig.covariance.rows());
  for (const Series& each : series) {
    for (const SeriesItem& item : each) {
      const size_t c = item.point->views[item.view].camera_idx;
      const Eigen::Index begin = rig.covariance_begin[c], size = rig.covariance_begin[c + 1] - begin;
      Eigen::MatrixXd by_calibration = Eigen::MatrixXd::Zero(2, size);
      Eigen::Matrix<double, 2, 3> by_x;
      if (!ProjectionByCalibration(rig, c, rig.origin_in_world + item.point->x_in_local, by_calibration, &by_x)) continue;
      moved.middleCols(begin, size).noalias() += Influence(item, rows) * by_calibration;
    }
  }
  return (moved * rig.covariance).cwiseProduct(moved).rowwise().sum();
}

/// Expected information of slopes that are noise of variance 1.
void AddSlopeInformation(const TimedPoint& point, const PointEquations& equations, Eigen::MatrixXd* information) {
  for (size_t v = 0; v < point.views.size(); ++v) {
    const double weight = point.views[v].weight;
    const Eigen::Matrix2d taken = equations.by_x[v] * equations.x_covariance * equations.by_x[v].transpose();
    const double free = weight * (2 - weight * taken.trace());
    const Eigen::Index first = kClockParams * static_cast<Eigen::Index>(point.views[v].camera_idx);
    const Eigen::Vector2d at(1, point.at);
    information->block<2, 2>(first, first) += free * at * at.transpose();
  }
}

/// Inverse of `information` less `noise`, of which at least a hundredth stays in every direction.
Eigen::MatrixXd InverseOfTrue(const Eigen::MatrixXd& information, const Eigen::MatrixXd& noise) {
  constexpr double kLeastPart = 0.01;
  const Eigen::LLT<Eigen::MatrixXd> factor(information);
  if (factor.info() != Eigen::Success)
    return Eigen::MatrixXd::Constant(information.rows(), information.cols(), std::numeric_limits<double>::quiet_NaN());
  const Eigen::MatrixXd half = factor.matrixL().solve(Eigen::MatrixXd::Identity(information.rows(), information.cols()));
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(half * noise * half.transpose());
  const Eigen::VectorXd left = (1 - axes.eigenvalues().array()).max(kLeastPart).inverse();
  return half.transpose() * axes.eigenvectors() * left.asDiagonal() * axes.eigenvectors().transpose() * half;
}

/// Offsets and drifts that are free.
std::vector<Eigen::Index> FreeClocks(Eigen::Index size, const std::vector<Eigen::Index>& held) {
  std::vector<Eigen::Index> free;
  for (Eigen::Index i = 0; i < size; ++i) {
    if (i % kClockParams < kClockShift && std::find(held.begin(), held.end(), i) == held.end()) free.push_back(i);
  }
  return free;
}

}  // namespace

ClockVariances MeasureClockVariances(const PreparedRig& rig, const std::vector<TimedPoint>& points,
                                     const Eigen::MatrixXd& information, const std::vector<Eigen::Index>& held) {
  const auto equations = AllEquations(points);
  const std::vector<Series> series = MakeSeries(points, equations);
  ClockVariances found{{SigmaOf(points, equations), SlopeSigmaOf(points, equations), CorrelationOf(series)}, {}, {}, {}};
  Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(information.rows(), information.cols());
  for (size_t i = 0; i < points.size(); ++i) {
    if (equations[i]) AddSlopeInformation(points[i], *equations[i], &slopes);
  }
  for (const Eigen::Index i : held) slopes.row(i).setZero(), slopes.col(i).setZero();
  found.inverse = InverseOfTrue(information, found.noise.sigma_px_per_frame * found.noise.sigma_px_per_frame * slopes);
  const std::vector<Eigen::Index> free = FreeClocks(information.rows(), held);
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(free.size()), information.cols());
  for (size_t k = 0; k < free.size(); ++k) rows.row(static_cast<Eigen::Index>(k)) = found.inverse.row(free[k]);
  Eigen::VectorXd variance = Eigen::VectorXd::Zero(rows.rows());
  for (const Series& each : series) variance += SeriesVariance(each, found.noise.correlation, rows);
  variance *= found.noise.sigma_px * found.noise.sigma_px;
  const Eigen::VectorXd by_calibration = CalibrationVariance(rig, series, rows);
  found.by_noise = found.by_calibration = Eigen::VectorXd::Zero(information.rows());
  for (size_t k = 0; k < free.size(); ++k) {
    found.by_noise[free[k]] = variance[static_cast<Eigen::Index>(k)];
    found.by_calibration[free[k]] = by_calibration[static_cast<Eigen::Index>(k)];
  }
  return found;
}

}  // namespace mvstudio::triangulate::internal
