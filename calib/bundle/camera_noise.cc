#include "calib/bundle/camera_noise.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "calib/bundle/bundle.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

constexpr double kDistanceToSigma = 0.8493218;  // median 2-D distance to standard deviation per coordinate
constexpr double kMinSigmaPx = 1e-7;            // below it, residuals are rounding errors and nothing is an outlier
constexpr double kMaxTail = 1.6;                // of the kept corners' standard deviation over the robust one
constexpr double kBorrowed = 40;   // corners' worth of the average that every camera's variance is mixed with, by logarithms
constexpr double kMaxRatio = 100;  // between the noise of two cameras
constexpr double kMinRedundancy = 0.2;

/// Variances per coordinate of the corners that count, per camera, and how many they are.
struct Variances {
  std::vector<double> variance, corners;
};

double SquaredSigma(std::vector<double> distances) {
  const double sigma = kDistanceToSigma * UpperMedian(std::move(distances), 0);
  return sigma * sigma;
}

/// `camera` -1: of all.
double RobustVariance(const std::vector<Eigen::VectorXd>& distances, const std::vector<View>& views, int camera) {
  std::vector<double> kept;
  for (size_t v = 0; v < views.size(); ++v) {
    if (camera >= 0 && views[v].camera_idx != camera) continue;
    for (Eigen::Index i = 0; i < views[v].size(); ++i) {
      if (views[v].weights[i] > 0) kept.push_back(distances[v][i]);
    }
  }
  return SquaredSigma(std::move(kept));
}

/// Of the kept corners, between the robust variance and a little more.
double KeptVariance(const std::vector<Eigen::VectorXd>& distances, const std::vector<View>& views, int camera) {
  const double robust = RobustVariance(distances, views, camera);
  double sum = 0;
  Eigen::Index count = 0;
  for (size_t v = 0; v < views.size(); ++v) {
    if (camera >= 0 && views[v].camera_idx != camera) continue;
    for (Eigen::Index i = 0; i < views[v].size(); ++i) {
      if (views[v].weights[i] > 0) sum += std::min(distances[v][i] * distances[v][i], 1e6 * robust), ++count;
    }
  }
  return std::clamp(sum / static_cast<double>(std::max<Eigen::Index>(1, 2 * count)), robust, kMaxTail * kMaxTail * robust);
}

std::vector<double> CountCorners(const std::vector<View>& views, size_t num_cameras) {
  std::vector<double> corners(num_cameras, 0);
  for (const View& view : views) corners[view.camera_idx] += static_cast<double>((view.weights.array() > 0).count());
  return corners;
}

/// Share of a camera's observations that its unknowns leave: its lens, its pose and its part of the boards' poses.
std::vector<double> Redundancies(const std::vector<View>& views, const RigState& state, const std::vector<double>& corners) {
  std::map<int, int> seers;
  std::vector<double> unknowns;
  for (const geometry::Camera& camera : state.cameras) unknowns.push_back(6 + static_cast<double>(camera.params.size()));
  for (const View& view : views) seers[view.frame] += (view.weights.array() > 0).any();
  for (const View& view : views) {
    if ((view.weights.array() > 0).any()) unknowns[view.camera_idx] += 6.0 / seers[view.frame];
  }
  std::vector<double> shares;
  for (size_t c = 0; c < corners.size(); ++c)
    shares.push_back(std::max(kMinRedundancy, 1 - unknowns[c] / std::max(1.0, 2 * corners[c])));
  return shares;
}

/// Geometric mean of a variance of `corners` corners and of what is borrowed.
double Borrow(double variance, double corners, double average) {
  const double floor = kMinSigmaPx * kMinSigmaPx;
  const double log_mean =
      (corners * std::log(std::max(floor, variance)) + kBorrowed * std::log(std::max(floor, average))) / (corners + kBorrowed);
  return std::exp(log_mean);
}

/// Every camera's variance mixed with that of all, which decides where a camera has few corners.
CameraNoise Mix(const std::vector<double>& variance, double variance_of_all, const std::vector<View>& views,
                const RigState& state) {
  const std::vector<double> corners = CountCorners(views, state.cameras.size()), share = Redundancies(views, state, corners);
  double squares = 0, freedom = 0, weights = 0, total = 0;
  for (size_t c = 0; c < corners.size(); ++c) squares += corners[c] * variance[c], freedom += corners[c] * share[c];
  const double average = std::max(kMinSigmaPx * kMinSigmaPx, squares / std::max(1.0, freedom));
  CameraNoise noise;
  for (size_t c = 0; c < corners.size(); ++c) {
    const double n = corners[c];
    noise.limit_px.push_back(std::sqrt(Borrow(variance[c], n, variance_of_all)));
    noise.weight.push_back(1 / std::max(Borrow(variance[c] / share[c], n, average), average / (kMaxRatio * kMaxRatio)));
    weights += n * noise.weight.back(), total += n;
  }
  for (double& weight : noise.weight) weight *= total / weights;
  return noise;
}

template <class VarianceOf>
CameraNoise Estimate(const std::vector<View>& views, const RigState& state, bool each_camera, VarianceOf&& variance_of) {
  const size_t cameras = state.cameras.size();
  const double all = variance_of(-1);
  if (!each_camera || cameras < 2) {
    const double limit = std::max(kMinSigmaPx, std::sqrt(all));
    return {std::vector<double>(cameras, limit), std::vector<double>(cameras, 1)};
  }
  std::vector<double> variance;
  for (size_t c = 0; c < cameras; ++c) variance.push_back(variance_of(static_cast<int>(c)));
  return Mix(variance, all, views, state);
}

}  // namespace

std::vector<Eigen::VectorXd> CornerDistances(const std::vector<View>& views, const RigState& state) {
  std::vector<Eigen::VectorXd> distances;
  for (const Eigen::Matrix2Xd& residuals : BundleResiduals(views, state)) distances.push_back(residuals.colwise().norm());
  return distances;
}

std::vector<Eigen::VectorXd> Standardized(const std::vector<View>& views, const RigState& state, const Priors& prior) {
  std::vector<Eigen::VectorXd> distances = CornerDistances(views, state);
  for (size_t v = 0; v < views.size(); ++v) {
    for (Eigen::Index i = 0; i < distances[v].size(); ++i) {
      if (prior[v][i] > 0) distances[v][i] *= std::sqrt(prior[v][i]);
    }
  }
  return distances;
}

CameraNoise RobustNoise(const std::vector<Eigen::VectorXd>& distances, const std::vector<View>& views, const RigState& state,
                        bool each_camera) {
  return Estimate(views, state, each_camera, [&](int camera) { return RobustVariance(distances, views, camera); });
}

CameraNoise KeptNoise(const std::vector<Eigen::VectorXd>& distances, const std::vector<View>& views, const RigState& state,
                      bool each_camera) {
  return Estimate(views, state, each_camera, [&](int camera) { return KeptVariance(distances, views, camera); });
}

std::vector<double> CameraSigmas(const std::vector<View>& views, const Priors& prior, double sigma_px, int num_cameras) {
  std::vector<double> sigmas(num_cameras, std::numeric_limits<double>::quiet_NaN());
  for (size_t v = 0; v < views.size(); ++v) {
    double& sigma = sigmas[views[v].camera_idx];
    for (Eigen::Index i = 0; i < views[v].size() && std::isnan(sigma); ++i) {
      if (views[v].weights[i] > 0 && prior[v][i] > 0) sigma = sigma_px * std::sqrt(prior[v][i] / views[v].weights[i]);
    }
  }
  return sigmas;
}

}  // namespace mvstudio::calib
