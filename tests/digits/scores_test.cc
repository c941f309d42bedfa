#include <cmath>
#include <limits>

#include "avatar/metrics/psnr.h"
#include "avatar/metrics/ssim.h"
#include "core/format.h"
#include "core/random.h"
#include "core/statistics.h"
#include "core/sum.h"
#include "tests/support/digits.h"
#include "tests/support/mp.h"
#include "tests/support/test.h"

/// Digits of scores between images, and of sums of many terms.
namespace mvstudio::metrics {
namespace {

constexpr int kMany = 10'000'000;
const char* const kMpfr = "definition in MPFR, 120 digits";
const char* const kClosed = "closed form";

DigitsCase Case(const std::string& what, const std::string& conditions, const std::string& oracle) {
  return {"Scores and sums", what, conditions, oracle};
}

PlanarImage Constant(int width, int height, double value, double range = 1) {
  return {width, height, 1, range, std::vector<double>(static_cast<size_t>(width) * height, value)};
}

PlanarImage Noise(int width, int height, double range, uint64_t seed) {
  PlanarImage image = Constant(width, height, 0, range);
  Rng rng(seed);
  for (double& sample : image.samples) sample = range * rng.Uniform();
  return image;
}

PlanarImage Mixed(const PlanarImage& a, const PlanarImage& b, double share) {
  PlanarImage mixed = a;
  for (size_t i = 0; i < a.samples.size(); ++i) mixed.samples[i] = (1 - share) * a.samples[i] + share * b.samples[i];
  return mixed;
}

/// Weights of one row of a window: Wang's Gaussian, or equal ones.
std::vector<Mp> WeightsOf(int side) {
  std::vector<Mp> weights;
  Mp total = 0;
  for (int k = -(side / 2); k <= side / 2; ++k) {
    weights.push_back(side == 7 ? Mp(1) : Mp(exp(-Mp(k * k) / (2 * Mp(1.5) * Mp(1.5)))));
    total += weights.back();
  }
  for (Mp& weight : weights) weight /= total;
  return weights;
}

/// One window, its top left pixel at (left, top).
Mp ExactWindow(const PlanarImage& a, const PlanarImage& b, int left, int top, const std::vector<Mp>& weights) {
  const int side = static_cast<int>(weights.size());
  const Mp c1 = Mp("1e-4"), c2 = Mp("9e-4"), scale = side == 7 ? Mp(49) / 48 : Mp(1);
  Mp mean_a = 0, mean_b = 0, squares_a = 0, squares_b = 0, products = 0;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const auto at = static_cast<size_t>(top + y) * static_cast<size_t>(a.width) + static_cast<size_t>(left + x);
      const Mp w = weights[static_cast<size_t>(x)] * weights[static_cast<size_t>(y)], pa = Mp(a.samples[at]) / Mp(a.range),
               pb = Mp(b.samples[at]) / Mp(b.range);
      mean_a += w * pa, mean_b += w * pb;
      squares_a += w * pa * pa, squares_b += w * pb * pb, products += w * pa * pb;
    }
  }
  const Mp variances = scale * (squares_a - mean_a * mean_a + squares_b - mean_b * mean_b),
           covariance = scale * (products - mean_a * mean_b);
  return (2 * mean_a * mean_b + c1) * (2 * covariance + c2) / ((mean_a * mean_a + mean_b * mean_b + c1) * (variances + c2));
}

Mp ExactSsim(const PlanarImage& a, const PlanarImage& b, int side) {
  const std::vector<Mp> weights = WeightsOf(side);
  const int rows = a.height - side + 1, columns = a.width - side + 1;
  Mp sum = 0;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) sum += ExactWindow(a, b, x, y, weights);
  }
  return sum / (rows * columns);
}

TEST(ScoreDigits, Ssim) {
  for (const auto& [window, side] : {std::pair{SsimWindow::kWang2004, 11}, {SsimWindow::kUniform7, 7}}) {
    const std::string name = side == 7 ? "SSIM, uniform window of 7" : "SSIM, Gaussian window of 11";
    for (const double range : {1e-300, 1.0, 255.0, 65535.0, 1e300}) {
      const PlanarImage a = Noise(21, 17, range, 1), b = Mixed(a, Noise(21, 17, range, 2), 0.5);
      RecordDigits(Case(name, Format("21x17, range %g", range), kMpfr), 13,
                   static_cast<double>(Mp(mvstudio::metrics::Ssim(a, b, window).value) / ExactSsim(a, b, side) - 1));
    }
    for (const double share : {1e-3, 1e-6}) {  // 1 - SSIM is about share^2
      const PlanarImage a = Noise(21, 17, 1, 1), b = Mixed(a, Noise(21, 17, 1, 2), share);
      const Mp left = 1 - ExactSsim(a, b, side);
      RecordDigits(Case("1 less " + name, Format("21x17, images %g apart", share), kMpfr),
                   testing::DigitsOf(1e-14 / (share * share)),
                   static_cast<double>((1 - Mp(mvstudio::metrics::Ssim(a, b, window).value)) / left - 1));
    }
  }
}

TEST(ScoreDigits, OneWindowAndManyPixels) {
  const PlanarImage a = Noise(11, 11, 1, 6), b = Noise(11, 11, 1, 7);
  RecordDigits(Case("SSIM, Gaussian window of 11", "one window", kMpfr), 13,
               static_cast<double>(Mp(Ssim(a, b).value) / ExactSsim(a, b, 11) - 1));
  const double low = 0.25, high = 0.75, expected = (2 * low * high + 1e-4) / (low * low + high * high + 1e-4);
  const Score many = Ssim(Constant(4000, 2500, low), Constant(4000, 2500, high));
  RecordDigits(Case("SSIM, Gaussian window of 11", "n = 1e7, constant images", kClosed), 12, many.value / expected - 1);
}

/// Mean squared difference of the samples as shares of the range.
Mp ExactSquares(const PlanarImage& a, const PlanarImage& b) {
  Mp sum = 0;
  for (size_t i = 0; i < a.samples.size(); ++i) {
    const Mp apart = (Mp(a.samples[i]) - Mp(b.samples[i])) / Mp(a.range);
    sum += apart * apart;
  }
  return sum / static_cast<double>(a.samples.size());
}

TEST(ScoreDigits, Psnr) {
  for (const double range : {1e-300, 1.0, 255.0, 1e300}) {
    const PlanarImage a = Noise(64, 48, range, 3), b = Noise(64, 48, range, 4);
    const Mp expected = -10 * log10(ExactSquares(a, b));
    RecordDigits(Case("PSNR", Format("64x48, range %g", range), kMpfr), 13,
                 static_cast<double>(Mp(PsnrDb(a, b).value) / expected - 1));
  }
  for (const double apart : {0.1, 1e-9, 1e-100}) {
    const PlanarImage zero = Constant(1, 1, 0), one = Constant(1, 1, apart);
    const double found = PsnrDb(zero, one).value;
    RecordDigits(Case("PSNR", Format("n = 1, %g apart", apart), kClosed), 14,
                 static_cast<double>(Mp(found) / (-20 * log10(Mp(apart))) - 1));
  }
  const PlanarImage zero = Constant(4000, 2500, 0), tenth = Constant(4000, 2500, 0.1);
  const auto as_error = [](double db) { return static_cast<double>(pow(Mp(10), -Mp(db) / 10) / (Mp(0.1) * Mp(0.1)) - 1); };
  RecordDigits(Case("mean squared error of PSNR", "n = 1e7, all pixels", kClosed), 12, as_error(PsnrDb(zero, tenth).value));
  RecordDigits(Case("mean squared error of PSNR", "n = 1e7, in a mask", kClosed), 12,
               as_error(PsnrDb(zero, tenth, Mask(zero.samples.size(), 1)).value));
  RecordDigits(Case("mean of PSNRs", "n = 1e7", kClosed), 14, MeanPsnr(std::vector<double>(kMany, 30.1)).mean_db / 30.1 - 1);
}

TEST(ScoreDigits, Sums) {
  const std::vector<double> tenths(kMany, 0.1);
  Sum sum;
  for (const double value : tenths) sum.Add(value);
  RecordDigits(Case("sum with what rounding loses (`Sum`)", "n = 1e7, all 0.1", kClosed), 15,
               static_cast<double>(Mp(sum.value()) / (Mp(0.1) * kMany) - 1));
  RecordDigits(Case("mean of statistics, by halves (`Mean`)", "n = 1e7, all 0.1", kClosed), 14,
               mvstudio::Mean(tenths) / 0.1 - 1);
  RecordDigits(Case("RMS of residuals, by halves (`Rms`)", "n = 1e7, all 0.1", kClosed), 14, Rms(tenths) / 0.1 - 1);
  Sum cancelling;
  for (const double term : {1.0, 1e100, 1.0, -1e100}) cancelling.Add(term);
  RecordDigits(Case("sum with what rounding loses (`Sum`)", "1, 1e100, 1, -1e100", kClosed), 15, cancelling.value() / 2 - 1);
  // Values far from zero: the deviations are of the mean, in a second pass.
  std::vector<double> far;
  for (int i = 0; i < 1000; ++i) far.push_back(1e9 + (i % 2 ? 0.5 : -0.5));
  RecordDigits(Case("standard deviation (`PopulationDeviation`)", "n = 1000, values 1e9 +- 0.5", kClosed), 13,
               PopulationDeviation(far) / 0.5 - 1);
  Sum endless;
  endless.Add(std::numeric_limits<double>::infinity()), endless.Add(1);
  RecordStatus(Case("sum with what rounding loses (`Sum`)", "infinity and 1", "plain addition"), "inf",
               Format("%g", endless.value()));
}

TEST(ScoreDigits, WhatHasNoScore) {
  const PlanarImage good = Noise(20, 20, 1, 8);
  const char* const definition = "definition";
  const auto of = [](const PlanarImage& a, const PlanarImage& b) {
    return std::string(ToString(Ssim(a, b).status)) + ", " + ToString(PsnrDb(a, b).status);
  };
  const auto record = [&](const std::string& what, const PlanarImage& other, const std::string& expected) {
    RecordStatus(Case("SSIM and PSNR", what, definition), expected, of(good, other));
  };
  PlanarImage other = good;
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    other.samples[7] = bad;
    record(Format("a sample is %g", bad), other, "NotFinite, NotFinite");
  }
  other.samples[7] = 1.01;
  record("a sample above the range", other, "OutsideRange, OutsideRange");
  record("another size", Noise(20, 21, 1, 8), "SizesDiffer, SizesDiffer");
  RecordStatus(Case("SSIM and PSNR", "n = 0", definition), "TooSmall, TooSmall", of({}, {}));
  for (const double range : {std::numeric_limits<double>::infinity(), 5e-324}) {
    const PlanarImage endless = Constant(20, 20, 0, range);
    RecordStatus(Case("SSIM and PSNR", Format("a range of %g", range), definition), "NotFinite, NotFinite",
                 of(endless, endless));
  }
}

}  // namespace
}  // namespace mvstudio::metrics
