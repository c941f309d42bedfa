#include "dataset/markers/filter.h"

#include <Eigen/Dense>
#include <cmath>

#include "core/error.h"
#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::markers {
namespace {

std::vector<double> Sine(double hz, double rate_hz, int count) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(std::sin(2 * M_PI * hz * i / rate_hz));
  return values;
}

/// Amplitude of the sine of that frequency in the middle half.
double Amplitude(const std::vector<double>& values, double hz, double rate_hz) {
  double s = 0, c = 0;
  const size_t begin = values.size() / 4, end = 3 * values.size() / 4;
  for (size_t i = begin; i < end; ++i) {
    const double phase = 2 * M_PI * hz * static_cast<double>(i) / rate_hz;
    s += values[i] * std::sin(phase), c += values[i] * std::cos(phase);
  }
  return 2 * std::hypot(s, c) / static_cast<double>(end - begin);
}

TEST(Butterworth, GainIsThatOfItsFormulaWithoutPhase) {
  // |H|² of each pass is 1 / (1 + (tan(w/2) / tan(wc/2))⁴) after the bilinear transform.
  const double rate = 100, cutoff = 6, single = cutoff / std::pow(std::sqrt(2.0) - 1, 0.25);
  for (const double hz : {0.5, 3.0, 6.0, 12.0, 30.0}) {
    const auto filtered = Butterworth(Sine(hz, rate, 4000), cutoff, rate);
    const double ratio = std::tan(M_PI * hz / rate) / std::tan(M_PI * single / rate);
    EXPECT_NEAR(Amplitude(filtered, hz, rate), 1 / (1 + std::pow(ratio, 4)), 2e-3) << hz;
    const auto truth = Sine(hz, rate, 4000);
    double cross = 0;  // with the quadrature: no phase
    for (size_t i = 1000; i < 3000; ++i) cross += filtered[i] * std::cos(2 * M_PI * hz * static_cast<double>(i) / rate);
    EXPECT_NEAR(cross / 2000, 0, 1e-3) << hz;
  }
  EXPECT_NEAR(Amplitude(Butterworth(Sine(6, rate, 4000), 6, rate), 6, rate), std::sqrt(0.5),
              0.012);  // bilinear warp of the 0.802
}

TEST(Butterworth, KeepsConstantsAndLinesToTheirEnds) {
  std::vector<double> line;
  for (int i = 0; i < 50; ++i) line.push_back(3 - 0.25 * i);
  const auto filtered = Butterworth(line, 6, 60);
  for (size_t i = 0; i < line.size(); ++i) EXPECT_NEAR(filtered[i], line[i], 2e-3) << i;
  for (const size_t count : {1u, 2u, 3u, 7u}) {
    const std::vector<double> constant(count, 4.5);
    for (const double value : Butterworth(constant, 6, 60)) EXPECT_NEAR(value, 4.5, 1e-12);
  }
}

TEST(Butterworth, CutOffMustFitTheRate) {
  EXPECT_THROW(Butterworth({1, 2, 3}, 30, 60), UsageError);
  EXPECT_THROW(Butterworth({1, 2, 3}, 0, 60), UsageError);
  EXPECT_THROW(Butterworth({1, 2, 3}, std::nan(""), 60), UsageError);
}

TEST(Kalman, EqualsTheLeastSquaresSolutionOfItsModel) {
  // States p, v, a of every time step as unknowns: values with 1/sigma², transitions with the inverse of the jerk's covariance.
  const double rate = 50, density = 40, dt = 1 / rate;
  const int n = 12;
  Rng rng(3);
  std::vector<double> values, sigma;
  for (int i = 0; i < n; ++i) values.push_back(std::sin(0.3 * i) + 0.01 * rng.Normal()), sigma.push_back(i % 3 ? 0.01 : 0.02);
  values[5] = values[6] = std::nan("");
  Eigen::Matrix3d transition, noise;
  transition << 1, dt, dt * dt / 2, 0, 1, dt, 0, 0, 1;
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {  // integral over the step of u^(2-a)/(2-a)! u^(2-b)/(2-b)!
      const double power = 5 - a - b, fact = std::tgamma(3 - a) * std::tgamma(3 - b);
      noise(a, b) = density * std::pow(dt, power) / (power * fact);
    }
  }
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(3 * n, 3 * n);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(3 * n);
  const Eigen::Matrix3d weight = noise.inverse();
  for (int i = 0; i < n; ++i) {
    if (std::isfinite(values[static_cast<size_t>(i)])) {
      const double w = 1 / (sigma[static_cast<size_t>(i)] * sigma[static_cast<size_t>(i)]);
      normal(3 * i, 3 * i) += w, right[3 * i] += w * values[static_cast<size_t>(i)];
    }
    if (i == 0) continue;
    Eigen::Matrix<double, 3, 6> jacobian;
    jacobian << -transition, Eigen::Matrix3d::Identity();
    normal.block<6, 6>(3 * i - 3, 3 * i - 3) += jacobian.transpose() * weight * jacobian;
  }
  const Eigen::VectorXd states = normal.ldlt().solve(right);
  const auto smooth = KalmanSmooth(values, sigma, density, rate);
  for (int i = 0; i < n; ++i) EXPECT_NEAR(smooth[static_cast<size_t>(i)], states[3 * i], 1e-6) << i;
}

TEST(Kalman, FindsTheJerkThatMadeTheMotion) {
  const double rate = 60, density = 100, dt = 1 / rate;
  Rng rng(11);
  std::vector<std::vector<double>> axes(3);
  for (auto& axis : axes) {
    double p = 0, v = 0, a = 0;
    for (int i = 0; i < 600; ++i) {
      for (int k = 0; k < 10; ++k) {
        const double h = dt / 10;
        p += v * h + a * h * h / 2, v += a * h, a += std::sqrt(density * h) * rng.Normal();
      }
      axis.push_back(p + 0.005 * rng.Normal());
    }
  }
  const double found = LikeliestJerk(axes, std::vector<double>(600, 0.005), rate);
  EXPECT_GT(found, density / 1.5);
  EXPECT_LT(found, density * 1.5);
}

TEST(Windows, GaussianAndMedian) {
  const auto spread = GaussianMean({0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0}, 1);
  double sum = 0;
  for (int k = -4; k <= 4; ++k) sum += std::exp(-0.5 * k * k);
  EXPECT_NEAR(spread[6], 1 / sum, 1e-12);
  EXPECT_NEAR(spread[7], std::exp(-0.5) / sum, 1e-12);
  EXPECT_EQ(MovingMedian({5, 1, 9, 2, 3}, 3), (std::vector<double>{5, 5, 2, 3, 3}));
  EXPECT_EQ(MovingMedian({1, 1, 100, 1, 1}, 5), (std::vector<double>{1, 1, 1, 1, 1}));
}

TEST(FilterSpec, WordsAndErrors) {
  for (const char* text : {"butterworth:4Hz", "gaussian:0.05s", "median:7", "kalman", "kalman:50", "none"}) {
    EXPECT_EQ(ToText(ParseFilter(text)), text);
  }
  EXPECT_EQ(ToText(ParseFilter("butterworth")), "butterworth:6Hz");
  EXPECT_EQ(ToText(ParseFilter("butterworth:6")), "butterworth:6Hz");
  for (const char* text : {"", "butter", "butterworth:", "butterworth:-3Hz", "butterworth:6kHz", "butterworth:nan", "median:4",
                           "median:2.5", "none:3", "gaussian:1e999s", "kalman:x"}) {
    EXPECT_THROW(ParseFilter(text), UsageError) << text;
  }
}

}  // namespace
}  // namespace mvstudio::markers
