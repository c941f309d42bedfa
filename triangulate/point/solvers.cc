#include "triangulate/point/solvers.h"

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "core/check.h"
#include "triangulate/point/refine.h"

namespace mvstudio::triangulate {
namespace {

using Eigen::Vector3d;
using Rows3 = Eigen::Matrix<double, Eigen::Dynamic, 3>;
using Rows4 = Eigen::Matrix<double, Eigen::Dynamic, 4>;

constexpr std::string_view kNames[] = {"midpoint", "dlt", "least-squares", "linear",   "lost", "mid2",
                                       "wmid2",    "l1",  "linf",          "all-views"};
constexpr double kRankTolerance = 1e-13;

LinearPoint NoPoint(Status status) { return {status, Vector3d::Zero()}; }

/// x P3 - z P1 and y P3 - z P2, the ray scaled to depth 1 (to a tenth of its length beyond 84 degrees off the axis).
Eigen::Matrix<double, 2, 4> PlaneRows(const View& view) {
  Eigen::Matrix<double, 3, 4> p;
  p << view.camera->cam_from_local_rotation, view.camera->cam_from_local_translation;
  Vector3d ray = view.camera->cam_from_local_rotation * view.ray_in_local;
  ray /= std::max(std::abs(ray.z()), 0.1);
  Eigen::Matrix<double, 2, 4> rows;
  rows << ray.x() * p.row(2) - ray.z() * p.row(0), ray.y() * p.row(2) - ray.z() * p.row(1);
  return rows;
}

Rows4 AllPlaneRows(const std::vector<View>& views) {
  Rows4 rows(2 * views.size(), 4);
  for (size_t i = 0; i < views.size(); ++i) rows.middleRows<2>(2 * static_cast<Eigen::Index>(i)) = PlaneRows(views[i]);
  return rows;
}

LinearPoint SolveInhomogeneous(const Rows3& a, const Eigen::VectorXd& b) {
  Eigen::ColPivHouseholderQR<Rows3> qr;
  qr.setThreshold(kRankTolerance);
  qr.compute(a);
  if (qr.rank() < 3) return NoPoint(Status::kDegenerate);
  return {Status::kOk, qr.solve(b)};
}

/// Distance of the point on ray i from its centre, by the law of sines with the view of largest parallax; 0 where there is
/// none.
double RangeByLawOfSines(const std::vector<View>& views, size_t i) {
  double best_sine = kRankTolerance, range = 0;
  for (size_t j = 0; j < views.size(); ++j) {
    const double sine = views[i].ray_in_local.cross(views[j].ray_in_local).norm();
    if (!(sine > best_sine)) continue;
    const Vector3d baseline = views[j].camera->center_in_local - views[i].camera->center_in_local;
    const double across = baseline.cross(views[j].ray_in_local).norm();
    if (!(across > 0)) continue;
    best_sine = sine, range = across / sine;
  }
  return range;
}

std::pair<size_t, size_t> WidestPair(const std::vector<View>& views) {
  std::pair<size_t, size_t> best(0, 1);
  double best_significance = -1;
  for (size_t i = 0; i < views.size(); ++i) {
    for (size_t j = i + 1; j < views.size(); ++j) {
      const double significance = ParallaxSignificance(views[i], views[j]);
      if (significance > best_significance) best_significance = significance, best = {i, j};
    }
  }
  return best;
}

/// Two rays of unit length, and the first centre seen from the second.
struct RayPair {
  RayPair(const View& a, const View& b)
      : p(a.ray_in_local), q(b.ray_in_local), t(a.camera->center_in_local - b.camera->center_in_local), from(b) {}
  Vector3d ToLocal(const Vector3d& x) const { return from.camera->center_in_local + x; }

  Vector3d p, q, t;
  const View& from;
};

/// Ranges by the law of sines, if they fit the signs of the rays.
struct Ranges {
  Status status;
  double p, q;
};

Ranges Mid2Ranges(const RayPair& rays) {
  const double sine = rays.p.cross(rays.q).norm();
  if (!(sine > kRankTolerance)) return {Status::kDegenerate, 0, 0};
  const Ranges ranges{Status::kOk, rays.q.cross(rays.t).norm() / sine, rays.p.cross(rays.t).norm() / sine};
  if (!(ranges.p > 0 && ranges.q > 0)) return {Status::kDegenerate, 0, 0};
  const Vector3d on_p = ranges.p * rays.p, on_q = ranges.q * rays.q;
  const double apart = (rays.t + on_p - on_q).squaredNorm();
  const double otherwise = std::min(
      {(rays.t + on_p + on_q).squaredNorm(), (rays.t - on_p - on_q).squaredNorm(), (rays.t - on_p + on_q).squaredNorm()});
  return apart < otherwise ? ranges : Ranges{Status::kBehindCamera, 0, 0};
}

/// Where two rays meet that lie in one plane with the baseline.
LinearPoint Intersect(const RayPair& rays, const Vector3d& p, const Vector3d& q) {
  const Vector3d z = q.cross(p);
  const double z2 = z.squaredNorm();
  if (!(z2 > kRankTolerance * kRankTolerance)) return NoPoint(Status::kDegenerate);
  const double range_p = z.dot(rays.t.cross(q)) / z2, range_q = z.dot(rays.t.cross(p)) / z2;
  if (!(range_p > 0 && range_q > 0)) return NoPoint(Status::kBehindCamera);
  return {Status::kOk, rays.ToLocal(0.5 * (rays.t + range_p * p + range_q * q))};
}

Vector3d OntoPlane(const Vector3d& ray, const Vector3d& normal) {
  return ray - ray.dot(normal) / normal.squaredNorm() * normal;
}

LinearPoint SolvePair(Solver solver, const View& a, const View& b) {
  if (solver == Solver::kMid2) return Mid2(a, b);
  if (solver == Solver::kWmid2) return InverseDepthWeightedMid2(a, b);
  return solver == Solver::kL1 ? L1Angular(a, b) : LinfAngular(a, b);
}

}  // namespace

std::string_view ToString(Solver solver) { return kNames[static_cast<int>(solver)]; }

std::optional<Solver> SolverFromString(std::string_view name) {
  for (const Solver solver : kAllSolvers) {
    if (ToString(solver) == name) return solver;
  }
  return std::nullopt;
}

bool IsTwoView(Solver solver) {
  return solver == Solver::kMid2 || solver == Solver::kWmid2 || solver == Solver::kL1 || solver == Solver::kLinf;
}

Solver SolverOf(PointMethod method) {
  if (method == PointMethod::kRobust || method == PointMethod::kAllViews) return Solver::kMaximumLikelihood;
  return SolverFromString(ToString(method)).value_or(Solver::kMaximumLikelihood);
}

LinearPoint HomogeneousDlt(const std::vector<View>& views) {
  if (views.size() < 2) return NoPoint(Status::kTooFewViews);
  Rows4 rows = AllPlaneRows(views);
  double extent = 0;
  for (const View& view : views) extent = std::max(extent, view.camera->center_in_local.norm());
  if (!(extent > 0)) return NoPoint(Status::kDegenerate);
  rows.col(3) /= extent;  // all four unknowns of one size
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(rows, Eigen::ComputeFullV);
  if (!(svd.singularValues()[2] > kRankTolerance * svd.singularValues()[0])) return NoPoint(Status::kDegenerate);
  const Eigen::Vector4d x = svd.matrixV().col(3);
  if (!(std::abs(x[3]) > kRankTolerance)) return NoPoint(Status::kDegenerate);
  return {Status::kOk, extent * x.hnormalized()};
}

LinearPoint InhomogeneousLeastSquares(const std::vector<View>& views) {
  if (views.size() < 2) return NoPoint(Status::kTooFewViews);
  const Rows4 rows = AllPlaneRows(views);
  return SolveInhomogeneous(rows.leftCols<3>(), -rows.col(3));
}

LinearPoint Lost(const std::vector<View>& views) {
  if (views.size() < 2) return NoPoint(Status::kTooFewViews);
  Rows3 a(2 * views.size(), 3);
  Eigen::VectorXd b(2 * views.size());
  for (size_t i = 0; i < views.size(); ++i) {
    const double range = RangeByLawOfSines(views, i);
    if (!(range > 0)) return NoPoint(Status::kDegenerate);
    const Eigen::Index row = 2 * static_cast<Eigen::Index>(i);
    a.middleRows<2>(row) = WhitenedRows(views[i]) / range;
    b.segment<2>(row) = a.middleRows<2>(row) * views[i].camera->center_in_local;
  }
  return SolveInhomogeneous(a, b);
}

LinearPoint Mid2(const View& a, const View& b) {
  const RayPair rays(a, b);
  const Ranges ranges = Mid2Ranges(rays);
  if (ranges.status != Status::kOk) return NoPoint(ranges.status);
  return {Status::kOk, rays.ToLocal(0.5 * (rays.t + ranges.p * rays.p + ranges.q * rays.q))};
}

LinearPoint InverseDepthWeightedMid2(const View& a, const View& b) {
  const RayPair rays(a, b);
  const Ranges ranges = Mid2Ranges(rays);
  if (ranges.status != Status::kOk) return NoPoint(ranges.status);
  const double sum = ranges.p + ranges.q;
  return {Status::kOk, rays.ToLocal(ranges.q / sum * (rays.t + ranges.p * rays.p) + ranges.p / sum * (ranges.q * rays.q))};
}

LinearPoint L1Angular(const View& a, const View& b) {
  const RayPair rays(a, b);
  const Vector3d n_p = rays.p.cross(rays.t), n_q = rays.q.cross(rays.t);
  if (!(std::max(n_p.squaredNorm(), n_q.squaredNorm()) > 0)) return NoPoint(Status::kDegenerate);
  if (n_p.squaredNorm() <= n_q.squaredNorm()) return Intersect(rays, OntoPlane(rays.p, n_q), rays.q);
  return Intersect(rays, rays.p, OntoPlane(rays.q, n_p));
}

LinearPoint LinfAngular(const View& a, const View& b) {
  const RayPair rays(a, b);
  const Vector3d sum = (rays.p + rays.q).cross(rays.t), difference = (rays.p - rays.q).cross(rays.t);
  const Vector3d& normal = sum.squaredNorm() >= difference.squaredNorm() ? sum : difference;
  if (!(normal.squaredNorm() > 0)) return NoPoint(Status::kDegenerate);
  return Intersect(rays, OntoPlane(rays.p, normal), OntoPlane(rays.q, normal));
}

LinearPoint MaximumLikelihood(const std::vector<View>& views) {
  LinearPoint start = Lost(views);
  if (start.status != Status::kOk) start = Midpoint(views);
  if (start.status != Status::kOk) return start;
  const Refinement best = Refine(views, start.x_in_local);
  return {best.status, best.x_in_local};
}

LinearPoint Solve(Solver solver, const std::vector<View>& views) {
  if (views.size() < 2) return NoPoint(Status::kTooFewViews);
  if (IsTwoView(solver)) {
    const auto [i, j] = WidestPair(views);
    return SolvePair(solver, views[i], views[j]);
  }
  switch (solver) {
    case Solver::kMidpoint:
      return Midpoint(views);
    case Solver::kDlt:
      return HomogeneousDlt(views);
    case Solver::kLeastSquares:
      return InhomogeneousLeastSquares(views);
    case Solver::kLinear:
      return WeightedLinear(views);
    case Solver::kLost:
      return Lost(views);
    default:
      return MaximumLikelihood(views);
  }
}

}  // namespace mvstudio::triangulate
