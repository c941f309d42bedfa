#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/check.h"
#include "core/statistics.h"
#include "dataset/masks/masks.h"

namespace mvstudio::dataset {
namespace {

/// Accounts for a camera that shakes by a fraction of a pixel: the colour step to the neighbours widens the noise at
/// edges. The effect is larger the fewer frames (`counts`) have shown the true variation.
void WidenAtEdges(const std::vector<int>& counts, BackgroundModel* model) {
  const Image& c = model->colour;
  constexpr double kTremblePx = 0.35, kEnough = 6;
  for (int y = 0; y < c.height; ++y) {
    for (int x = 0; x < c.width; ++x) {
      const int xa = std::max(x - 1, 0), xb = std::min(x + 1, c.width - 1), ya = std::max(y - 1, 0),
                yb = std::min(y + 1, c.height - 1);
      double step = 0;
      for (int k = 0; k < 3; ++k) {
        const double dx = 0.5 * (c.Pixel(xb, y)[k] - c.Pixel(xa, y)[k]), dy = 0.5 * (c.Pixel(x, yb)[k] - c.Pixel(x, ya)[k]);
        step = std::max(step, std::hypot(dx, dy));
      }
      const size_t i = static_cast<size_t>(y) * c.width + x;
      const double tremble_px = kTremblePx * std::min(1.0, kEnough / std::max(1, counts[i]));
      model->sigma[i] = static_cast<float>(std::min(std::hypot(model->sigma[i], tremble_px * step), 40.0));
    }
  }
}

}  // namespace

double BackgroundModel::KnownFraction() const {
  if (known.empty()) return 0;
  return static_cast<double>(std::count(known.begin(), known.end(), uint8_t{1})) / static_cast<double>(known.size());
}

BackgroundModel LearnBackground(const std::vector<Image>& frames, const std::vector<Image>& people,
                                const MaskOptions& options) {
  MVS_CHECK(!frames.empty() && frames.size() == people.size(), frames.size() << " frames, " << people.size() << " masks");
  const int w = frames[0].width, h = frames[0].height;
  for (size_t f = 0; f < frames.size(); ++f) {
    MVS_CHECK(frames[f].width == w && frames[f].height == h && people[f].width == w && people[f].height == h, "sizes differ");
  }
  const int enough = std::clamp<int>(static_cast<int>(frames.size()) / 8, 1, 4);
  BackgroundModel model{Image(w, h, 3), std::vector<float>(size_t(w) * h), std::vector<uint8_t>(size_t(w) * h, 0)};
  std::vector<uint8_t> values(frames.size());
  std::vector<const uint8_t*> free_pixels(frames.size());
  std::vector<int> counts(size_t(w) * h, 0);
  for (size_t i = 0; i < size_t(w) * h; ++i) {
    int count = 0;
    for (size_t f = 0; f < frames.size(); ++f) {
      if (people[f].pixels[i] == 0) free_pixels[count++] = &frames[f].pixels[3 * i];
    }
    if (count < enough) continue;
    model.known[i] = 1;
    counts[i] = count;
    double deviation = 0;
    for (int k = 0; k < 3; ++k) {
      for (int f = 0; f < count; ++f) values[f] = free_pixels[f][k];
      const int median = UpperMedian(values.begin(), values.begin() + count);
      model.colour.pixels[3 * i + k] = static_cast<uint8_t>(median);
      for (int f = 0; f < count; ++f) deviation += std::min(std::abs(free_pixels[f][k] - median), 20);
    }
    model.sigma[i] = static_cast<float>(std::max(options.noise_levels, 1.2533 * deviation / (3.0 * count)));
  }
  WidenAtEdges(counts, &model);
  return model;
}

BackgroundModel BackgroundFromPlate(const Image& plate, const MaskOptions& options) {
  MVS_CHECK(plate.channels == 3 && !plate.empty(), "a plate is an RGB image");
  const size_t n = size_t(plate.width) * plate.height;
  BackgroundModel model{plate, std::vector<float>(n, static_cast<float>(2.5 * options.noise_levels)),
                        std::vector<uint8_t>(n, 1)};
  WidenAtEdges(std::vector<int>(n, 1), &model);
  return model;
}

double ColourMixture::Cost(const Eigen::Vector3d& rgb) const {
  constexpr double kUniformShare = 0.02;
  double density = kUniformShare / (256.0 * 256.0 * 256.0);
  for (const Component& c : components) {
    const double d2 = (c.whitening * (rgb - c.mean)).squaredNorm();
    if (d2 < 60) density += std::exp(c.log_weight + c.log_norm - 0.5 * d2);
  }
  return -std::log(density);
}

namespace {

/// Cluster index of each colour after a few rounds of k-means.
std::vector<int> Cluster(const Eigen::Matrix3Xf& rgb, int k) {
  const Eigen::Index n = rgb.cols();
  std::vector<Eigen::Index> order(n);
  for (Eigen::Index i = 0; i < n; ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](auto a, auto b) { return rgb.col(a).sum() < rgb.col(b).sum(); });
  Eigen::Matrix3Xf centres(3, k);
  for (int c = 0; c < k; ++c) centres.col(c) = rgb.col(order[(2 * c + 1) * n / (2 * k)]);
  std::vector<int> cluster(n, 0);
  for (int round = 0; round < 12; ++round) {
    Eigen::Matrix3Xd sums = Eigen::Matrix3Xd::Zero(3, k);
    Eigen::VectorXd counts = Eigen::VectorXd::Zero(k);
    for (Eigen::Index i = 0; i < n; ++i) {
      Eigen::Index best = 0;
      (centres.colwise() - rgb.col(i)).colwise().squaredNorm().minCoeff(&best);
      cluster[i] = static_cast<int>(best);
      sums.col(best) += rgb.col(i).cast<double>();
      counts[best] += 1;
    }
    for (int c = 0; c < k; ++c) {
      if (counts[c] > 0) centres.col(c) = (sums.col(c) / counts[c]).cast<float>();
    }
  }
  return cluster;
}

}  // namespace

ColourMixture FitColours(const Eigen::Matrix3Xf& rgb, int num_components) {
  ColourMixture mixture;
  const Eigen::Index n = rgb.cols();
  if (n == 0) return mixture;
  const int k = static_cast<int>(std::min<Eigen::Index>(num_components, n));
  const std::vector<int> cluster = Cluster(rgb, k);
  for (int c = 0; c < k; ++c) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    double count = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (cluster[i] != c) continue;
      sum += rgb.col(i).cast<double>();
      count += 1;
    }
    if (count == 0) continue;
    ColourMixture::Component component;
    component.mean = sum / count;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (cluster[i] != c) continue;
      const Eigen::Vector3d d = rgb.col(i).cast<double>() - component.mean;
      squares += d * d.transpose();
    }
    const Eigen::Matrix3d covariance = squares / count + 9.0 * Eigen::Matrix3d::Identity();  // at least 3 levels wide
    const Eigen::Matrix3d factor = covariance.llt().matrixL();
    component.whitening = factor.inverse();
    component.log_norm = -1.5 * std::log(2 * M_PI) - std::log(factor.determinant());
    component.log_weight = std::log(count / static_cast<double>(n));
    mixture.components.push_back(component);
  }
  return mixture;
}

}  // namespace mvstudio::dataset
