#include "calib/detect/circle_refine.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "calib/board/homography.h"
#include "core/statistics.h"
#include "core/units.h"
#include "geometry/solve/least_squares.h"

namespace mvstudio::calib {
namespace {

// x, y of the centre; r00, r01, r11 of the triangle R with |R (x - centre)| = 1 on the outline; blur, level, half contrast,
// slope x, slope y
constexpr int kNumUnknowns = 10;
using Unknowns = Eigen::Matrix<double, kNumUnknowns, 1>;

constexpr double kLeastBlur = 0.25, kMostBlur = 6, kLeastContrast = 12;

struct Pixel {
  double x = 0, y = 0, grey = 0;  // relative to the first guess
};

/// Grey value at a place, and its gradient; the length of the outline's gradient counts as constant, which it nearly is where
/// the outline runs.
double GreyAt(const Unknowns& p, double x, double y, Unknowns* gradient) {
  const double qx = x - p[0], qy = y - p[1];
  const double u = p[2] * qx + p[3] * qy, v = p[4] * qy;
  const double f = std::max(1e-9, std::hypot(u, v));
  const Eigen::Vector2d along(p[2] * u, p[3] * u + p[4] * v);  // R^T R q: f times the gradient of f
  const double slope = std::max(1e-9, along.norm() / f);
  const double d = (f - 1) / slope, k = 1 / (std::sqrt(2.0) * p[5]);
  const double edge = std::erf(d * k), bell = 2 / std::sqrt(kPi) * k * std::exp(-d * d * k * k);
  const double by_d = p[7] * bell, by_f = by_d / (slope * f);
  (*gradient) << -by_f * along.x(), -by_f * along.y(), by_f * u * qx, by_f * u * qy, by_f * v * qy, -by_d * d / p[5], 1, edge,
      x, y;
  return p[6] + p[7] * edge + p[8] * x + p[9] * y;
}

struct SpotProblem : geometry::LeastSquaresProblem<kNumUnknowns, Unknowns> {
  const std::vector<Pixel>& pixels;
  explicit SpotProblem(const std::vector<Pixel>& of) : pixels(of) {}

  bool Linearize(const Unknowns& p, Equations* l) const {
    Unknowns g;
    for (const Pixel& pixel : pixels) {
      const double r = GreyAt(p, pixel.x, pixel.y, &g) - pixel.grey;
      l->h.selfadjointView<Eigen::Lower>().rankUpdate(g);
      l->g += r * g;
      l->cost += r * r;
    }
    l->h = l->h.selfadjointView<Eigen::Lower>();
    return true;
  }
  Unknowns Retract(const Unknowns& p, const Unknowns& step) const {
    Unknowns next = p + step;
    next[5] = std::clamp(next[5], kLeastBlur, kMostBlur);
    return next;
  }
  geometry::StepVerdict Judge(const geometry::LeastSquaresOptions& options, const Unknowns& step, const Equations& at,
                              const Equations* trial) const {
    if (!trial || !(trial->cost <= at.cost)) return geometry::StepVerdict::kRefuse;
    return step.head<2>().norm() < options.step_tolerance ? geometry::StepVerdict::kTakeLast : geometry::StepVerdict::kTake;
  }
};

/// R of a shape: R^T R = shape^-1.
Eigen::Matrix2d OutlineOf(const Eigen::Matrix2d& shape) { return shape.inverse().llt().matrixU(); }

/// The pixels near the outline.
std::vector<Pixel> PixelsAround(const Image& grey, const Spot& spot) {
  const Eigen::Matrix2d r = OutlineOf(spot.shape);
  const double reach = std::sqrt(spot.shape.diagonal().maxCoeff()) + 7;
  const double radius = std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(spot.shape).eigenvalues()[0]);
  const double outside = std::clamp(0.45 * radius, 2.0, 5.0), inside = std::clamp(0.9 * radius, 2.0, 6.0);
  std::vector<Pixel> pixels;
  const auto low = [&](double at) { return std::max(0, static_cast<int>(std::floor(at - reach))); };
  for (int v = low(spot.px.y()); v <= std::min<double>(grey.height - 1, spot.px.y() + reach); ++v) {
    for (int u = low(spot.px.x()); u <= std::min<double>(grey.width - 1, spot.px.x() + reach); ++u) {
      const Eigen::Vector2d q = Eigen::Vector2d(u, v) - spot.px, mapped = r * q;
      const double f = std::max(1e-9, mapped.norm()), slope = std::max(1e-9, (r.transpose() * mapped).norm() / f);
      const double d = (f - 1) / slope;
      if (d <= outside && d >= -inside) pixels.push_back({q.x(), q.y(), static_cast<double>(*grey.Pixel(u, v))});
    }
  }
  return pixels;
}

Unknowns FirstUnknowns(const std::vector<Pixel>& pixels, const Spot& spot) {
  const auto [low, high] =
      std::minmax_element(pixels.begin(), pixels.end(), [](const Pixel& a, const Pixel& b) { return a.grey < b.grey; });
  const Eigen::Matrix2d r = OutlineOf(spot.shape);
  Unknowns p;
  p << 0, 0, r(0, 0), r(0, 1), r(1, 1), 1, (low->grey + high->grey) / 2, std::max(1.0, (high->grey - low->grey) / 2), 0, 0;
  return p;
}

/// Centroid of a polygon.
Eigen::Vector2d CentroidOf(const Eigen::Matrix2Xd& outline) {
  const Eigen::Vector2d origin = outline.col(0);
  double area = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (Eigen::Index i = 0; i < outline.cols(); ++i) {
    const Eigen::Vector2d a = outline.col(i) - origin, b = outline.col((i + 1) % outline.cols()) - origin;
    const double cross = a.x() * b.y() - a.y() * b.x();
    area += cross, sum += cross * (a + b);
  }
  return origin + sum / (3 * area);
}

/// From the image of a circle's centre to the centroid of its image.
Eigen::Vector2d Displacement(const PlaneToImage& plane, const Eigen::Vector2d& centre, double radius) {
  constexpr int kSides = 48;
  Eigen::Matrix2Xd outline(2, kSides);
  for (int k = 0; k < kSides; ++k) {
    const double angle = 2 * kPi * k / kSides;
    outline.col(k) = plane(centre + radius * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  return CentroidOf(outline) - plane(centre);
}

/// The radius on the board that the spots' areas tell, of most of them.
double CommonRadius(const PlaneToImage& plane, const Eigen::Matrix2Xd& on_board, const std::vector<Spot>& spots, double step) {
  std::vector<double> radii;
  for (Eigen::Index i = 0; i < on_board.cols(); ++i) {
    const Eigen::Vector2d at = on_board.col(i), x(0.25 * step, 0), y(0, 0.25 * step);
    const Eigen::Vector2d along_x = (plane(at + x) - plane(at - x)) / (0.5 * step);
    const Eigen::Vector2d along_y = (plane(at + y) - plane(at - y)) / (0.5 * step);
    const double scale = std::abs(along_x.x() * along_y.y() - along_x.y() * along_y.x());
    radii.push_back(std::sqrt(spots[static_cast<size_t>(i)].area_px() / (kPi * scale)));
  }
  return UpperMedian(std::move(radii));
}

}  // namespace

FittedSpot FitSpot(const Image& grey, const Spot& start, double max_misfit) {
  FittedSpot result;
  result.spot = start;
  const std::vector<Pixel> pixels = PixelsAround(grey, start);
  result.status = Status::kTooFewViews;
  if (pixels.size() < 2 * kNumUnknowns) return result;
  geometry::LeastSquaresOptions options;
  options.max_iterations = 30;
  options.first_damping = 1e-3, options.least_damping = 1e-9, options.max_damping = 1e7;
  options.step_tolerance = 1e-4;
  const auto fit = geometry::SolveLeastSquares(SpotProblem(pixels), FirstUnknowns(pixels, start), options);
  const Unknowns& p = fit.state;
  const double rms = std::sqrt(fit.equations.cost / static_cast<double>(pixels.size()));
  const Eigen::Matrix2d r = (Eigen::Matrix2d() << p[2], p[3], 0, p[4]).finished();
  result.status = Status::kOutlier;
  const bool solved = fit.status == Status::kOk || fit.status == Status::kNotConverged;
  const double limit = 0.5 * std::sqrt(start.shape.trace());
  if (!solved || !p.allFinite() || p.head<2>().norm() > limit || !(std::abs(r.determinant()) > 1e-9)) return result;
  if (2 * p[7] < kLeastContrast || rms > max_misfit * p[7] || !(p[5] < kMostBlur)) return result;
  result.status = Status::kOk;
  result.spot.px += p.head<2>();
  result.spot.shape = (r.transpose() * r).inverse();
  const Eigen::Matrix2d covariance = fit.equations.h.inverse().topLeftCorner<2, 2>() * std::max(rms * rms, 1.0);
  result.sigma_px = std::sqrt(std::max(0.0, covariance.trace() / 2));
  return result;
}

Eigen::Matrix2Xd CentresSeen(const Eigen::Matrix2Xd& on_board, const std::vector<Spot>& spots) {
  constexpr int kRounds = 3;
  Eigen::Matrix2Xd found(2, spots.size());
  for (size_t i = 0; i < spots.size(); ++i) found.col(static_cast<Eigen::Index>(i)) = spots[i].px;
  Eigen::Matrix2Xd centres = found;
  const double step = (on_board.col(1) - on_board.col(0)).norm();
  for (int round = 0; round < kRounds; ++round) {
    const auto plane = PlaneToImage::Fit(on_board, centres);
    if (!plane) return found;
    const double radius = CommonRadius(*plane, on_board, spots, step);
    for (Eigen::Index i = 0; i < centres.cols(); ++i)
      centres.col(i) = found.col(i) - Displacement(*plane, on_board.col(i), radius);
  }
  return centres.allFinite() ? centres : found;
}

}  // namespace mvstudio::calib
