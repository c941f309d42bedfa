#include <Eigen/Cholesky>
#include <cmath>

#include "dataset/markers/filter.h"

namespace mvstudio::markers {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

struct Model {
  Matrix3d transition, noise;
};

/// Continuous white jerk over a step of `dt` seconds.
Model WhiteJerk(double density, double dt) {
  Model model;
  model.transition << 1, dt, dt * dt / 2, 0, 1, dt, 0, 0, 1;
  const double d2 = dt * dt, d3 = d2 * dt, d4 = d3 * dt, d5 = d4 * dt;
  model.noise << d5 / 20, d4 / 8, d3 / 6, d4 / 8, d3 / 3, d2 / 2, d3 / 6, d2 / 2, dt;
  model.noise *= density;
  return model;
}

struct Step {
  Vector3d predicted, filtered;
  Matrix3d predicted_covariance, filtered_covariance;
};

/// Joseph's form keeps the covariance positive.
void Update(double value, double variance, Step* step, double* log_likelihood) {
  const double innovation = value - step->filtered[0], total = step->filtered_covariance(0, 0) + variance;
  const Vector3d gain = step->filtered_covariance.col(0) / total;
  Matrix3d keep = Matrix3d::Identity();
  keep.col(0) -= gain;
  step->filtered += gain * innovation;
  step->filtered_covariance = keep * step->filtered_covariance * keep.transpose() + variance * gain * gain.transpose();
  if (log_likelihood) *log_likelihood -= 0.5 * (std::log(total) + innovation * innovation / total);
}

/// What the first values allow, against their own scale: as good as nothing.
Step Begin(const std::vector<double>& values, double dt) {
  constexpr double kMetres = 100;
  Step step;
  step.filtered.setZero();
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    step.filtered[0] = value;
    break;
  }
  step.filtered_covariance = Vector3d(kMetres, kMetres / dt, kMetres / (dt * dt)).array().square().matrix().asDiagonal();
  return step;
}

}  // namespace

std::vector<double> KalmanSmooth(const std::vector<double>& values, const std::vector<double>& sigma, double jerk_density,
                                 double rate_hz, double* log_likelihood) {
  if (log_likelihood) *log_likelihood = 0;
  if (values.empty()) return {};
  const double dt = 1 / rate_hz;
  const Model model = WhiteJerk(jerk_density, dt);
  std::vector<Step> steps(values.size());
  for (size_t i = 0; i < values.size(); ++i) {
    Step& step = steps[i];
    if (i == 0) {
      step = Begin(values, dt);
    } else {
      step.filtered = model.transition * steps[i - 1].filtered;
      step.filtered_covariance =
          model.transition * steps[i - 1].filtered_covariance * model.transition.transpose() + model.noise;
    }
    step.predicted = step.filtered, step.predicted_covariance = step.filtered_covariance;
    // The first three values only settle the flat prior.
    if (std::isfinite(values[i])) Update(values[i], sigma[i] * sigma[i], &step, i < 3 ? nullptr : log_likelihood);
  }
  std::vector<double> smooth(values.size());
  Vector3d state = steps.back().filtered;
  smooth.back() = state[0];
  for (size_t i = values.size() - 1; i-- > 0;) {
    const Matrix3d cross = model.transition * steps[i].filtered_covariance;
    state = steps[i].filtered +
            steps[i + 1].predicted_covariance.ldlt().solve(cross).transpose() * (state - steps[i + 1].predicted);
    smooth[i] = state[0];
  }
  return smooth;
}

double LikeliestJerk(const std::vector<std::vector<double>>& coordinates, const std::vector<double>& sigma, double rate_hz) {
  const auto value = [&](double log_density) {
    double sum = 0;
    for (const auto& values : coordinates) {
      double likelihood = 0;
      KalmanSmooth(values, sigma, std::exp(log_density), rate_hz, &likelihood);
      sum += likelihood;
    }
    return sum;
  };
  constexpr double kGolden = 0.6180339887498949;
  double low = std::log(1e-4), high = std::log(1e8);
  double a = high - kGolden * (high - low), b = low + kGolden * (high - low), at_a = value(a), at_b = value(b);
  for (int i = 0; i < 14; ++i) {  // to within 4 %
    if (at_a > at_b) {
      high = b, b = a, at_b = at_a, a = high - kGolden * (high - low), at_a = value(a);
    } else {
      low = a, a = b, at_a = at_b, b = low + kGolden * (high - low), at_b = value(b);
    }
  }
  return std::exp((low + high) / 2);
}

}  // namespace mvstudio::markers
