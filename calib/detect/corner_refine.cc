#include "calib/detect/corner_refine.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "calib/board/apriltag.h"
#include "calib/board/charuco_layout.h"
#include "core/units.h"
#include "geometry/solve/least_squares.h"

namespace mvstudio::calib {
namespace {

constexpr int kNumParams =
    9;  // x, y, angle of the edge along x, angle of the edge along y, blur, level, half contrast, slope x, slope y
using Params = Eigen::Matrix<double, kNumParams, 1>;

constexpr double kWindowSquares = 0.46;  // of a square, so that neighbouring corners stay outside
constexpr double kMinBlur = 0.25, kMaxBlur = 6;

struct Sample {
  double x = 0, y = 0;  // relative to the first guess, px
  double grey = 0, weight = 1;
};

/// Grey value around a corner with sharp edges, for a and b in {-1, 1} (the side of the edge along x, of that along y; positive
/// towards +y and +x): level + contrast (one + a + b + ab), the four terms being these factors.
struct Shape {
  double one = 0, a = 0, b = 0, ab = 0;
  static Shape Crossing(double sign) { return {0, 0, 0, sign}; }
  /// `sign` in the quadrant where the sides are `a_side` and `b_side`, -sign elsewhere.
  static Shape Angle(double a_side, double b_side, double sign) {
    return {-0.5 * sign, 0.5 * sign * a_side, 0.5 * sign * b_side, 0.5 * sign * a_side * b_side};
  }
};

/// What may be seen around a corner, in squares from it: `x`, `y` along the board's axes.
class Neighbourhood {
 public:
  Neighbourhood(const Board& board, int corner_id, double px_per_square) : board_(board) {
    blur_ = 1 / px_per_square;
    board.has_tags() ? SetTag(corner_id) : SetSquares(corner_id);
  }

  const Shape& shape() const { return shape_; }

  /// False where something else than the corner's two edges may be seen.
  bool Shows(double x, double y) const { return board_.has_tags() ? ShowsTag(x, y) : ShowsSquares(x, y); }

 private:
  /// Distance from an edge up to which a strip of width `strip` beside it is free of what lies behind.
  double Clear(double strip) const { return std::max(strip - blur_, blur_); }

  void SetSquares(int corner_id) {
    col_ = corner_id % board_.cols, row_ = corner_id / board_.cols;
    shape_ = Shape::Crossing(IsBlack(board_, {col_, row_}) ? -1 : 1);  // a b is positive in the upper left square
    strip_ = Clear((board_.square_m - board_.marker_m) / (2 * board_.square_m));
  }

  bool ShowsSquares(double x, double y) const {
    if (board_.kind != Board::Kind::kCharuco) return true;
    const bool white = !IsBlack(board_, {col_ + (x > 0), row_ + (y > 0)});
    return !white || std::min(std::abs(x), std::abs(y)) <= strip_;
  }

  void SetTag(int corner_id) {
    const int k = corner_id % 4;
    inside_x_ = k == 0 || k == 3 ? 1 : -1, inside_y_ = k >= 2 ? 1 : -1;
    const auto family = FindTagFamily(board_.dictionary);
    const double cell = family ? 1.0 / family->border_cells : 0;
    gap_squares_ = board_.kind == Board::Kind::kAprilGrid && family && !family->white_inside;
    const double inside = family && family->white_inside ? 1 : -1;
    shape_ = gap_squares_ ? Shape::Crossing(inside * inside_x_ * inside_y_) : Shape::Angle(inside_y_, inside_x_, inside);
    strip_ = Clear(cell);
    outside_ = Clear(gap_squares_ ? board_.tag_spacing : cell);
  }

  bool ShowsTag(double x, double y) const {
    const double u = x * inside_x_, v = y * inside_y_;  // positive: inside
    if (u > 0 && v > 0) return std::min(u, v) <= strip_;
    return u > -outside_ && v > -outside_;
  }

  const Board& board_;
  Shape shape_;
  double blur_ = 0, strip_ = 1, outside_ = 1;
  int col_ = 0, row_ = 0, inside_x_ = 1, inside_y_ = 1;
  bool gap_squares_ = false;
};

/// The pixels around the guess that show nothing but the corner's two edges.
std::vector<Sample> CollectSamples(const Neighbourhood& neighbourhood, const Image& grey, const CornerGuess& guess,
                                   double radius_px) {
  Eigen::Matrix2d px_from_squares;
  px_from_squares << guess.along_x, guess.along_y;
  const Eigen::Matrix2d squares_from_px = px_from_squares.inverse();
  const int u0 = static_cast<int>(std::floor(guess.px.x())), v0 = static_cast<int>(std::floor(guess.px.y()));
  const int reach = static_cast<int>(std::ceil(radius_px)) + 1;
  std::vector<Sample> samples;
  for (int v = std::max(0, v0 - reach); v <= std::min(grey.height - 1, v0 + reach); ++v) {
    for (int u = std::max(0, u0 - reach); u <= std::min(grey.width - 1, u0 + reach); ++u) {
      const Eigen::Vector2d d(u - guess.px.x(), v - guess.px.y());
      const Eigen::Vector2d s = squares_from_px * d;
      if (d.norm() > radius_px || s.cwiseAbs().maxCoeff() > kWindowSquares) continue;
      if (!neighbourhood.Shows(s.x(), s.y())) continue;
      const double taper = 1 - 0.75 * d.squaredNorm() / (radius_px * radius_px);
      samples.push_back({d.x(), d.y(), static_cast<double>(*grey.Pixel(u, v)), taper});
    }
  }
  return samples;
}

/// Model grey value and its gradient with respect to the parameters.
double Evaluate(const Params& p, double x, double y, const Shape& shape, Params* gradient) {
  const double dx = x - p[0], dy = y - p[1];
  const double ca = std::cos(p[2]), sa = std::sin(p[2]), cb = std::cos(p[3]), sb = std::sin(p[3]);
  const double across_a = -sa * dx + ca * dy,
               along_a = ca * dx + sa * dy;  // distance from the edge along x, positive towards +y
  const double across_b = sb * dx - cb * dy,
               along_b = cb * dx + sb * dy;  // distance from the edge along y, positive towards +x
  const double k = 1 / (std::sqrt(2.0) * p[4]);
  const double a = std::erf(across_a * k), b = std::erf(across_b * k);
  const double bell = 2 / std::sqrt(kPi) * k;
  const double da = bell * std::exp(-across_a * across_a * k * k), db = bell * std::exp(-across_b * across_b * k * k);
  const double pattern = shape.one + shape.a * a + shape.b * b + shape.ab * a * b;
  const double by_a = p[6] * da * (shape.a + shape.ab * b), by_b = p[6] * db * (shape.b + shape.ab * a);
  (*gradient)[0] = sa * by_a - sb * by_b;
  (*gradient)[1] = -ca * by_a + cb * by_b;
  (*gradient)[2] = -along_a * by_a;
  (*gradient)[3] = along_b * by_b;
  (*gradient)[4] = -(across_a * by_a + across_b * by_b) / p[4];
  (*gradient)[5] = 1;
  (*gradient)[6] = pattern;
  (*gradient)[7] = x;
  (*gradient)[8] = y;
  return p[5] + p[6] * pattern + p[7] * x + p[8] * y;
}

struct Linearized : geometry::NormalEquations<kNumParams> {
  double weight = 0;
};

struct CornerProblem : geometry::LeastSquaresProblem<kNumParams, Params, Linearized> {
  const std::vector<Sample>& samples;
  const Shape& shape;

  CornerProblem(const std::vector<Sample>& of, const Shape& seen) : samples(of), shape(seen) {}

  bool Linearize(const Params& p, Linearized* l) const {
    Params g;
    for (const Sample& s : samples) {
      const double r = Evaluate(p, s.x, s.y, shape, &g) - s.grey;
      l->h.selfadjointView<Eigen::Lower>().rankUpdate(g, s.weight);
      l->g += s.weight * r * g;
      l->cost += s.weight * r * r;
      l->weight += s.weight;
    }
    l->h = l->h.selfadjointView<Eigen::Lower>();
    return true;
  }

  Params Retract(const Params& p, const Params& step) const {
    Params next = p + step;
    next[4] = std::clamp(next[4], kMinBlur, kMaxBlur);
    return next;
  }

  Params SolveStep(const Linearized& at, double damping) const { return geometry::DampedStep(at.h, at.g, damping, 1e-12); }

  geometry::StepVerdict Judge(const geometry::LeastSquaresOptions& options, const Params& step, const Linearized& at,
                              const Linearized* trial) const {
    if (!trial || !(trial->cost <= at.cost)) return geometry::StepVerdict::kRefuse;
    const bool rests = step.head<2>().norm() < options.step_tolerance;  // of the corner alone
    return rests ? geometry::StepVerdict::kTakeLast : geometry::StepVerdict::kTake;
  }
};

Params FirstParams(const std::vector<Sample>& samples, const CornerGuess& guess) {
  double low = 255, high = 0, sum = 0;
  for (const Sample& s : samples) low = std::min(low, s.grey), high = std::max(high, s.grey), sum += s.grey;
  Params p = Params::Zero();
  p[2] = std::atan2(guess.along_x.y(), guess.along_x.x());
  p[3] = std::atan2(guess.along_y.y(), guess.along_y.x());
  p[4] = 1;
  p[5] = (low + high) / 2;
  p[6] = std::max(1.0, (high - low) / 2);
  return p;
}

geometry::LeastSquaresEnd<CornerProblem> Fit(const CornerProblem& problem, const Params& start, int max_iterations) {
  geometry::LeastSquaresOptions options;
  options.max_iterations = max_iterations;
  options.first_damping = 1e-3, options.least_damping = 1e-9, options.max_damping = 1e7;
  options.step_tolerance = 1e-4;
  return geometry::SolveLeastSquares(problem, start, options);
}

RefinedCorner Failed(Status status, const Eigen::Vector2d& px) {
  RefinedCorner corner;
  corner.status = status;
  corner.px = px;
  return corner;
}

}  // namespace

RefinedCorner RefineCorner(const Board& board, const Image& grey, const CornerGuess& guess, const RefineOptions& options) {
  if (!guess.px.allFinite() || !guess.along_x.allFinite() || !guess.along_y.allFinite()) {
    return Failed(Status::kNonFiniteInput, guess.px);
  }
  const double px_per_square = std::min(guess.along_x.norm(), guess.along_y.norm());
  const double area = std::abs(guess.along_x.x() * guess.along_y.y() - guess.along_x.y() * guess.along_y.x());
  if (px_per_square < 3 || area < 0.15 * guess.along_x.norm() * guess.along_y.norm())
    return Failed(Status::kDegenerate, guess.px);
  const double longest =
      kWindowSquares * std::max((guess.along_x + guess.along_y).norm(), (guess.along_x - guess.along_y).norm());
  const double radius = std::min(options.max_radius_px, longest);
  if (guess.px.x() < 2 || guess.px.y() < 2 || guess.px.x() > grey.width - 3 || guess.px.y() > grey.height - 3) {
    return Failed(Status::kOutsideValidRadius, guess.px);
  }
  const Neighbourhood neighbourhood(board, guess.corner_id, px_per_square);
  const std::vector<Sample> samples = CollectSamples(neighbourhood, grey, guess, radius);
  if (samples.size() < 2 * kNumParams) return Failed(Status::kTooFewViews, guess.px);

  const auto fit = Fit(CornerProblem(samples, neighbourhood.shape()), FirstParams(samples, guess), options.max_iterations);
  if (fit.status != Status::kOk && fit.status != Status::kNotConverged) return Failed(Status::kNotConverged, guess.px);
  const Params& p = fit.state;
  const Linearized& end = fit.equations;

  RefinedCorner corner;
  corner.px = guess.px + p.head<2>();
  const double rms = std::sqrt(end.cost / end.weight);
  corner.misfit = rms / std::max(1e-9, p[6]);
  const Eigen::Matrix2d covariance = end.h.inverse().topLeftCorner<2, 2>() * std::max(rms * rms, 1.0);
  corner.sigma_px = std::sqrt(std::max(0.0, covariance.trace() / 2));
  const double max_shift = std::max(1.5, (board.has_tags() ? 0.05 : 0.3) * px_per_square);
  const bool plausible = 2 * p[6] >= options.min_contrast && corner.misfit <= options.max_misfit && p[4] < kMaxBlur;
  if (!plausible || p.head<2>().norm() > max_shift || !corner.px.allFinite()) corner.status = Status::kOutlier;
  return corner;
}

}  // namespace mvstudio::calib
