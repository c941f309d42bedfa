#include <cmath>
#include <limits>

#include "core/format.h"
#include "tests/support/digits.h"
#include "tests/support/test.h"
#include "tests/triangulate/oracle.h"
#include "tests/triangulate/support.h"
#include "triangulate/batch/batch.h"
#include "triangulate/point/solvers.h"

/// Digits of triangulated points: every solver where rays cross at any angle, the most likely point, units, origins, focal
/// lengths.
namespace mvstudio::triangulate {
namespace {

using oracle::Mp;

const char* const kOptimum = "most likely point, MPFR, 120 digits";

DigitsCase Case(const std::string& what, const std::string& conditions, const std::string& oracle) {
  return {"Triangulation", what, conditions, oracle};
}

std::vector<View> ViewsOf(const PreparedRig& rig, const std::vector<Observation>& observations) {
  Status rejected;
  return MakeViews(rig, observations, &rejected);
}

/// Distance of `x` from the optimum, as a share of `size`.
double Apart(const Eigen::Vector3d& x, const oracle::Optimum& best, double size) {
  return static_cast<double>((oracle::ToMp(x) - best.x_in_world).norm()) / size;
}

double InSigmas(const Point& point, const oracle::Optimum& best) {
  const Eigen::Vector3d apart = oracle::ToDouble(oracle::Vector3(oracle::ToMp(point.x_in_world) - best.x_in_world));
  return std::sqrt(apart.dot(point.covariance.inverse() * apart));
}

/// Rounding of pixels of 1000 px a radian is 1e-16, and the depth's error grows with the inverse square of the angle.
TEST(PointDigits, EverySolverAtEveryParallax) {
  const Eigen::Vector3d truth(0.01, -0.02, 0.1);
  for (const Solver solver : kAllSolvers) {
    for (const double deg : {90.0, 10.0, 1.0, 0.1, 0.01}) {
      const geometry::Rig rig = TwoCameras(DegToRad(deg));
      const PreparedRig prepared = Prepare(rig);
      const LinearPoint found = Solve(solver, ViewsOf(prepared, Observe(rig, truth, 0, nullptr, 1e-6)));
      const double error =
          found.status == Status::kOk ? (found.x_in_local + prepared.origin_in_world - truth).norm() / 3 : std::nan("");
      const double sine = std::sin(DegToRad(deg));
      RecordDigits(Case("`" + std::string(ToString(solver)) + "`", Format("2 views, parallax %g deg", deg), "the point itself"),
                   testing::DigitsOf(1e-13 / (sine * sine)), error);
    }
  }
}

TEST(PointDigits, NumbersOfViews) {
  for (const Solver solver :
       {Solver::kMidpoint, Solver::kDlt, Solver::kLeastSquares, Solver::kLost, Solver::kMaximumLikelihood}) {
    for (const int views : {2, 3, 31, 520}) {
      const geometry::Rig rig = MakeRing(std::max(views, 3));
      const PreparedRig prepared = Prepare(rig);
      const Eigen::Vector3d truth(0.2, -0.1, 0.3);
      std::vector<Observation> observations = Observe(rig, truth);
      observations.resize(static_cast<size_t>(views));
      const LinearPoint found = Solve(solver, ViewsOf(prepared, observations));
      const double error =
          found.status == Status::kOk ? (found.x_in_local + prepared.origin_in_world - truth).norm() / 3 : std::nan("");
      RecordDigits(Case("`" + std::string(ToString(solver)) + "`", Format("%d views, 5 lens terms", views), "the point itself"),
                   12, error);
    }
  }
}

TEST(PointDigits, MostLikelyPointOfNoisyViews) {
  Rng rng(13);
  for (const int views : {2, 3, 8, 31, 520}) {
    const geometry::Rig rig = MakeRing(std::max(views, 3));
    std::vector<Observation> observations = Observe(rig, RandomPoint(&rng), 1, &rng);
    observations.resize(static_cast<size_t>(views));
    const Point point = TriangulatePoint(Prepare(rig), observations, {PointMethod::kAllViews});
    ASSERT_EQ(point.status, Status::kOk) << views;
    const oracle::Optimum best = oracle::MostLikely(rig, observations, point.x_in_world, 8);
    const std::string where = Format("%d views, noise 1 px", views);
    RecordDigits(Case("point, in its standard deviations", where, kOptimum), 6, InSigmas(point, best));
    RecordDigits(Case("chi-squared", where, kOptimum), 9, point.chi_squared / static_cast<double>(best.chi_squared) - 1);
    const oracle::Matrix3 exact = best.information.inverse();
    WorstError worst;
    for (int i = 0; i < 9; ++i)
      worst.Add((point.covariance(i / 3, i % 3) - static_cast<double>(exact(i / 3, i % 3))) / point.covariance.trace());
    RecordDigits(Case("covariance", where, kOptimum), 6, worst.value());
  }
}

TEST(PointDigits, UnitsAndFocalLengths) {
  const Eigen::Vector3d place(0.2, -0.1, 0.3);
  for (const double size : {1e-9, 1e-3, 1e3, 1e9, 1e16}) {
    geometry::Rig rig = MakeRing(5);
    for (geometry::RigCamera& camera : rig.cameras) camera.cam_from_world.translation *= size;
    const Point point = TriangulatePoint(Prepare(rig), Observe(rig, size * place, 0, nullptr, 0.5));
    const double error = point.status == Status::kOk ? (point.x_in_world - size * place).norm() / (3 * size) : std::nan("");
    RecordDigits(Case("`robust`", Format("5 views, a rig of %g m", size), "the point itself"), 12, error);
  }
  for (const double focal : {1e-3, 1.0, 1e3, 1e6, 1e9}) {
    geometry::Rig rig;
    for (const double deg : {0.0, 40.0, 95.0}) {
      rig.cameras.push_back(LookAt("c" + std::to_string(deg),
                                   3 * Eigen::Vector3d(std::cos(DegToRad(deg)), std::sin(DegToRad(deg)), 0.1), {0, 0, 0},
                                   focal));
    }
    const Eigen::Vector3d truth = place * std::min(1.0, 1000 / focal);
    std::vector<Observation> observations = Observe(rig, truth, 0, nullptr, 1e-3 * focal);
    const Point point = TriangulatePoint(Prepare(rig), observations);
    ASSERT_EQ(point.status, Status::kOk) << focal;
    // The observed pixels are rounded: the optimum of these, not the point, is what can be found.
    RecordDigits(Case("`robust`", Format("3 views, f = %g px", focal), kOptimum), 9,
                 Apart(point.x_in_world, oracle::MostLikely(rig, observations, truth), 3));
  }
}

TEST(PointDigits, FarOrigins) {
  for (const double far : {1e3, 1e6, 1e9}) {
    const Eigen::Vector3d middle = far * Eigen::Vector3d(0.6, -0.7, 0.4);
    const geometry::Rig rig = MakeRing(5, 3, middle);
    std::vector<Observation> observations;
    for (int c = 0; c < 5; ++c) {
      oracle::Vector2 px;
      oracle::Project(rig.cameras[static_cast<size_t>(c)], oracle::ToMp(middle) + oracle::ToMp({0.2, -0.1, 0.3}), &px);
      observations.push_back({c, {static_cast<double>(px[0]), static_cast<double>(px[1])}, 0.5, 1.0});
    }
    const Point point = TriangulatePoint(Prepare(rig), observations, {PointMethod::kAllViews});
    ASSERT_EQ(point.status, Status::kOk) << far;
    RecordDigits(Case("`all-views`, share of the coordinates", Format("5 views, origin %g m away", far), kOptimum), 14,
                 Apart(point.x_in_world, oracle::MostLikely(rig, observations, middle), far));
  }
}

/// Two cameras whose rays are parallel, but for `sine`: the point lies 6 m / sine away.
Status OfParallelRays(double sine, double sigma_px) {
  geometry::Rig rig;
  for (const double y : {-3.0, 3.0}) rig.cameras.push_back(LookAt(y < 0 ? "left" : "right", {0, y, 0}, {10, y, 0}));
  const double half = 1000 * sine / 2;
  return TriangulatePoint(Prepare(rig), {{0, {639.5 - half, 479.5}, sigma_px, 1}, {1, {639.5 + half, 479.5}, sigma_px, 1}})
      .status;
}

TEST(PointDigits, ParallaxTowardsNothing) {
  const char* const rule = "5 standard deviations of the parallax";
  for (const double sine : {1e-1, 1e-3, 1e-6, 1e-9, 0.0}) {
    const bool enough = sine > 0 && sine * 1000 > 5 * 0.1 * std::sqrt(2.0);
    RecordStatus(Case("status", Format("2 views, sine of parallax %g, noise 0.1 px", sine), rule),
                 enough ? "Ok" : "LowParallax", ToString(OfParallelRays(sine, 0.1)));
  }
  RecordStatus(Case("status", "2 views, rays that part by 0.1, noise 0.1 px", "they meet behind"), "BehindCamera",
               ToString(OfParallelRays(-0.1, 0.1)));
}

TEST(PointDigits, WhatIsNoPoint) {
  const geometry::Rig rig = MakeRing(4);
  const PreparedRig prepared = Prepare(rig);
  const std::vector<Observation> good = Observe(rig, {0.1, 0.2, 0.1});
  const auto with = [&](double x, double sigma) {
    std::vector<Observation> two = {good[0], good[1]};
    two[1].px.x() = x, two[1].sigma_px = sigma;
    return std::string(ToString(TriangulatePoint(prepared, two).status));
  };
  const char* const definition = "definition";
  RecordStatus(Case("status", "a pixel is NaN", definition), "NonFiniteInput", with(std::nan(""), 1));
  RecordStatus(Case("status", "a pixel is infinite", definition), "NonFiniteInput",
               with(std::numeric_limits<double>::infinity(), 1));
  RecordStatus(Case("status", "a sigma is NaN", definition), "NonFiniteInput", with(good[1].px.x(), std::nan("")));
  RecordStatus(Case("status", "one view", definition), "TooFewViews", ToString(TriangulatePoint(prepared, {good[0]}).status));
  RecordStatus(Case("status", "two views of one camera centre", definition), "Degenerate", [&] {
    geometry::Rig one_centre;
    for (const double y : {-1.0, 1.0}) one_centre.cameras.push_back(LookAt(y < 0 ? "a" : "b", {1, 2, 3}, {10, y, 0}));
    const Eigen::Vector2d middle(639.5, 479.5);
    return ToString(
        TriangulatePoint(Prepare(one_centre), {{0, middle, 1, 1}, {1, middle + Eigen::Vector2d(3, 0), 1, 1}}).status);
  }());
}

TEST(PointDigits, BatchesAreSinglePoints) {
  const geometry::Rig rig = MakeRing(6);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(8);
  for (const int64_t count : {int64_t{1}, int64_t{20000}}) {
    PointBatch batch = MakeBatch(6, count);
    std::vector<Point> expected;
    for (int64_t i = 0; i < count; ++i) {
      const std::vector<Observation> seen = Observe(rig, RandomPoint(&rng), 0.5, &rng);
      for (const Observation& each : seen) {
        const auto at = static_cast<size_t>(each.camera_idx * count + i);
        batch.x_px[at] = each.px.x(), batch.y_px[at] = each.px.y();
      }
      PointOptions options;
      options.seed += static_cast<uint64_t>(i);
      expected.push_back(TriangulatePoint(prepared, seen, options));
    }
    const BatchResult found = TriangulateBatch(prepared, batch);
    WorstError worst;
    for (int64_t i = 0; i < count; ++i) {
      const Point& point = expected[static_cast<size_t>(i)];
      ASSERT_EQ(found.StatusOf(i), point.status) << i;
      if (point.status == Status::kOk)
        worst.Add((Eigen::Vector3d(found.x[i], found.y[i], found.z[i]) - point.x_in_world).norm() / 3);
    }
    RecordDigits(Case("batch, worst point", Format("6 views, n = %lld", static_cast<long long>(count)), "one point at a time"),
                 8, worst.value());
  }
}

}  // namespace
}  // namespace mvstudio::triangulate
