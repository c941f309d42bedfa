#include "dataset/colour/channel_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/statistics.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr int kMaxIterations = 60;
constexpr double kHuber = 1.345;            // 95 % as good as least squares on normal noise
constexpr double kLeastSigma = 0.25 / 255;  // rounding alone
constexpr double kMaxResponseSigma = 0.05;
constexpr double kGaugeWeight = 1e6;

/// The state of the solve: responses and blacks; true values follow from them.
struct Solution {
  Eigen::VectorXd response, black;
};

double TrueValue(const ChannelPoint& point, const std::vector<double>& robust, const Solution& s) {
  double top = 0, bottom = 0;
  for (size_t i = 0; i < point.views.size(); ++i) {
    const double a = s.response[point.views[i].camera];
    top += robust[i] * a * (point.views[i].value - s.black[point.views[i].camera]), bottom += robust[i] * a * a;
  }
  return bottom > 0 ? top / bottom : 0;
}

/// Weighted residuals of a point at its best true value, which it returns; two rounds settle the robust weights.
double Residuals(const ChannelPoint& point, const Solution& s, double sigma, std::vector<double>* robust,
                 std::vector<double>* residuals) {
  robust->assign(point.views.size(), 1), residuals->resize(point.views.size());
  const double scale = std::sqrt(point.weight);
  double value = 0;
  for (int round = 0; round < 3; ++round) {
    value = TrueValue(point, *robust, s);
    for (size_t i = 0; i < point.views.size(); ++i) {
      const ChannelView& view = point.views[i];
      (*residuals)[i] = scale * (view.value - s.response[view.camera] * value - s.black[view.camera]);
      const double size = std::abs((*residuals)[i]) / (kHuber * sigma);
      (*robust)[i] = size > 1 ? 1 / size : 1;
    }
  }
  return value;
}

/// Normal equations of responses and blacks with the true values eliminated.
struct Normal {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd right;
  double cost = 0;
};

void AddPoint(const ChannelPoint& point, const Solution& s, double sigma, bool with_black, Normal* normal) {
  std::vector<double> robust, residuals;
  const double value = Residuals(point, s, sigma, &robust, &residuals);
  const int n = static_cast<int>(s.response.size()), width = with_black ? 2 : 1;
  const double scale = std::sqrt(point.weight);
  double value_value = 0, value_right = 0;
  std::vector<Eigen::Vector2d> cross(point.views.size());
  for (size_t i = 0; i < point.views.size(); ++i) {
    const int c = point.views[i].camera;
    const Eigen::Vector2d own(scale * value, with_black ? scale : 0);  // derivatives of the model
    const double of_value = scale * s.response[c], w = robust[i];
    value_value += w * of_value * of_value, value_right += w * of_value * residuals[i];
    cross[i] = w * of_value * own;
    for (int p = 0; p < width; ++p) {
      for (int q = 0; q < width; ++q) normal->matrix(c + p * n, c + q * n) += w * own[p] * own[q];
      normal->right[c + p * n] += w * own[p] * residuals[i];
    }
    const double size = std::abs(residuals[i]) / sigma;
    normal->cost += size > kHuber ? kHuber * (2 * size - kHuber) : size * size;
  }
  if (!(value_value > 0)) return;
  for (size_t i = 0; i < point.views.size(); ++i) {
    for (int p = 0; p < width; ++p) {
      const int row = point.views[i].camera + p * n;
      normal->right[row] -= cross[i][p] * value_right / value_value;
      for (size_t j = 0; j < point.views.size(); ++j) {
        for (int q = 0; q < width; ++q) {
          normal->matrix(row, point.views[j].camera + q * n) -= cross[i][p] * cross[j][q] / value_value;
        }
      }
    }
  }
}

void AddGauge(const Solution& s, bool with_black, Normal* normal) {
  const int n = static_cast<int>(s.response.size());
  const double weight = kGaugeWeight * std::max(normal->matrix.diagonal().maxCoeff(), 1e-300) / n;
  const Eigen::VectorXd inverse = s.response.cwiseInverse();
  normal->matrix.topLeftCorner(n, n) += weight * inverse * inverse.transpose();
  normal->right.head(n) -= weight * s.response.array().log().sum() * inverse;
  if (!with_black) return;
  normal->matrix.bottomRightCorner(n, n).array() += weight;
  normal->right.tail(n).array() -= weight * s.black.sum();
}

Normal Build(const std::vector<ChannelPoint>& points, const Solution& s, double sigma, bool with_black) {
  const Eigen::Index size = s.response.size() * (with_black ? 2 : 1);
  Normal normal{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size), 0};
  for (const ChannelPoint& point : points) AddPoint(point, s, sigma, with_black, &normal);
  AddGauge(s, with_black, &normal);
  return normal;
}

double Sigma(const std::vector<ChannelPoint>& points, const Solution& s, double old_sigma) {
  std::vector<double> sizes, robust, residuals;
  for (const ChannelPoint& point : points) {
    Residuals(point, s, old_sigma, &robust, &residuals);
    const double freedom = std::sqrt(1 - 1.0 / static_cast<double>(point.views.size()));
    for (const double r : residuals) sizes.push_back(std::abs(r) / freedom);
  }
  return std::max(kLeastSigma, kSigmaPerMad * UpperMedian(std::move(sizes)));
}

/// Largest standard deviation of a response relative to itself; infinity when the equations do not fix it.
double WorstResponseSigma(const Normal& normal, const Solution& s, double sigma) {
  const Eigen::LDLT<Eigen::MatrixXd> solver(normal.matrix);
  const Eigen::VectorXd pivots = solver.vectorD();
  if (!(pivots.minCoeff() > 1e-15 * pivots.maxCoeff())) return INFINITY;
  const Eigen::MatrixXd inverse = solver.solve(Eigen::MatrixXd::Identity(normal.matrix.rows(), normal.matrix.cols()));
  const Eigen::Index n = s.response.size();
  return sigma * (inverse.diagonal().head(n).cwiseMax(0).cwiseSqrt().array() / s.response.array()).maxCoeff();
}

}  // namespace

ChannelFit FitChannel(const std::vector<ChannelPoint>& points, int num_cameras, bool with_black) {
  Solution s{Eigen::VectorXd::Ones(num_cameras), Eigen::VectorXd::Zero(num_cameras)};
  ChannelFit fit;
  fit.status = Status::kDegenerate;
  fit.response = s.response, fit.black = s.black, fit.worst_response_sigma = INFINITY;
  if (points.empty()) return fit;
  double sigma = Sigma(points, s, 1);
  Normal normal;
  bool converged = false;
  for (int i = 0; i < kMaxIterations && !converged; ++i) {
    sigma = Sigma(points, s, sigma);
    normal = Build(points, s, sigma, with_black);
    const Eigen::VectorXd step = normal.matrix.ldlt().solve(normal.right);
    if (!step.allFinite()) return fit;
    const double longest = step.cwiseAbs().maxCoeff(), part = std::min(1.0, 0.3 / std::max(longest, 1e-300));
    s.response += part * step.head(num_cameras);
    if (with_black) s.black += part * step.tail(num_cameras);
    s.response = s.response.cwiseMax(0.02);
    converged = longest < 1e-7;
  }
  normal = Build(points, s, sigma, with_black);
  fit.response = s.response, fit.black = s.black, fit.sigma = sigma;
  fit.worst_response_sigma = WorstResponseSigma(normal, s, sigma);
  fit.status = !(fit.worst_response_sigma <= kMaxResponseSigma) ? Status::kDegenerate
               : converged                                      ? Status::kOk
                                                                : Status::kNotConverged;
  return fit;
}

}  // namespace mvstudio::dataset::internal
