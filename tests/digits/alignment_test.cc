#include "geometry/rig/alignment.h"

#include <Eigen/SVD>
#include <cmath>
#include <limits>

#include "core/format.h"
#include "core/random.h"
#include "geometry/rigid/decompositions.h"
#include "tests/support/digits.h"
#include "tests/support/mp.h"
#include "tests/support/test.h"

/// Digits of the least-squares transform between points, against Umeyama's solution of the same numbers in MPFR.
namespace mvstudio::geometry {
namespace {

using Matrix3mp = Eigen::Matrix<Mp, 3, 3>;
using Vector3mp = Eigen::Matrix<Mp, 3, 1>;
using Points = Eigen::Matrix3Xd;

DigitsCase Case(const std::string& what, const std::string& conditions,
                const std::string& oracle = "Umeyama in MPFR, 120 digits") {
  return {"Alignment", what, conditions, oracle};
}

struct Exact {
  Matrix3mp rotation;
  Vector3mp translation;
  Mp scale;
};

/// Umeyama 1991, equations 38 to 43.
Exact Umeyama(const Points& a, const Points& b) {
  const Mp n(a.cols());
  Vector3mp mean_a = Vector3mp::Zero(), mean_b = Vector3mp::Zero();
  for (Eigen::Index i = 0; i < a.cols(); ++i) mean_a += a.col(i).cast<Mp>() / n, mean_b += b.col(i).cast<Mp>() / n;
  Matrix3mp covariance = Matrix3mp::Zero();
  Mp variance = 0;
  for (Eigen::Index i = 0; i < a.cols(); ++i) {
    const Vector3mp from = a.col(i).cast<Mp>() - mean_a, to = b.col(i).cast<Mp>() - mean_b;
    covariance += to * from.transpose() / n;
    variance += from.squaredNorm() / n;
  }
  const Eigen::JacobiSVD<Matrix3mp> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Vector3mp sign = Vector3mp::Ones();
  if (covariance.determinant() < 0) sign[2] = -1;
  Exact exact;
  exact.rotation = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  exact.scale = svd.singularValues().dot(sign) / variance;
  exact.translation = mean_b - exact.scale * (exact.rotation * mean_a);
  return exact;
}

Points Cloud(Rng* rng, int count, const Eigen::Vector3d& size) {
  Points points(3, count);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    points.col(i) = size.cwiseProduct(Eigen::Vector3d(rng->Normal(), rng->Normal(), rng->Normal()));
  }
  return points;
}

/// Turned, scaled by 1.3 and with noise of 5 %.
Points MovedWithNoise(Rng* rng, const Points& a, double unit) {
  const Eigen::Matrix3d turn = RotationExp({0.4, -2.1, 1.3}).toRotationMatrix();
  return (1.3 * turn * a).colwise() + unit * Eigen::Vector3d(3, -7, 0.5) +
         0.05 * unit * Cloud(rng, static_cast<int>(a.cols()), {1, 1, 1});
}

/// `size` of the coordinates, of which the translation is a share.
void Record(const std::string& conditions, const Points& a, const Points& b, double size, int expected) {
  const Alignment found = AlignPoints(a, b, true);
  ASSERT_EQ(found.status, Status::kOk) << conditions;
  const Exact exact = Umeyama(a, b);
  const Matrix3mp rotation = found.b_from_a.rotation.toRotationMatrix().cast<Mp>();
  RecordDigits(Case("rotation", conditions), expected, static_cast<double>((rotation - exact.rotation).norm()));
  RecordDigits(Case("scale", conditions), expected, static_cast<double>(Mp(found.scale) / exact.scale - 1));
  RecordDigits(Case("translation, share of the coordinates", conditions), expected,
               static_cast<double>((found.b_from_a.translation.cast<Mp>() - exact.translation).norm()) / size);
}

TEST(AlignmentDigits, NumbersOfPoints) {
  for (const int count : {3, 30, 100000}) {
    Rng rng(1);
    const Points a = Cloud(&rng, count, {1, 1, 1});
    Record(Format("n = %d", count), a, MovedWithNoise(&rng, a, 1), 1, 12);
  }
}

TEST(AlignmentDigits, Units) {
  for (const double unit : {1e-100, 1e-9, 1e9, 1e100}) {
    Rng rng(2);
    const Points a = Cloud(&rng, 20, {unit, unit, unit});
    Record(Format("n = 20, unit %g m", unit), a, MovedWithNoise(&rng, a, unit), unit, 13);
  }
}

TEST(AlignmentDigits, FarOrigins) {
  for (const double far : {1e3, 1e6, 1e9}) {
    Rng rng(3);
    const Eigen::Vector3d middle = far * Eigen::Vector3d(0.6, -0.7, 0.4);
    const Points near = Cloud(&rng, 20, {1, 1, 1}), a = near.colwise() + middle,
                 b = MovedWithNoise(&rng, near, 1).colwise() - middle;
    Record(Format("n = 20, origins %g m away", far), a, b, far, 13);
  }
}

/// What a turn about the longest direction moves shrinks with the others: by the square, as the solution is that of the
/// covariance.
TEST(AlignmentDigits, FlatAndNarrowClouds) {
  for (const double thin : {1e-3, 1e-6}) {
    Rng rng(4);
    const Points flat = Cloud(&rng, 20, {1, 1, thin}), narrow = Cloud(&rng, 20, {1, thin, thin});
    Record(Format("n = 20, extents 1, 1, %g", thin), flat, MovedWithNoise(&rng, flat, 1), 1, 12);
    Points moved = MovedWithNoise(&rng, narrow, 0);
    Record(Format("n = 20, extents 1, %g, %g", thin, thin), narrow, moved, 1, testing::DigitsOf(1e-15 / (thin * thin)));
  }
}

TEST(AlignmentDigits, WhatHasNoTransform) {
  Rng rng(5);
  const char* const definition = "definition";
  const auto of = [](const Points& a) { return ToString(AlignPoints(a, a).status); };
  RecordStatus(Case("status", "n = 2", definition), "TooFewViews", of(Cloud(&rng, 2, {1, 1, 1})));
  RecordStatus(Case("status", "on a line", definition), "Degenerate", of(Cloud(&rng, 9, {1, 0, 0})));
  const Points line = Cloud(&rng, 9, {1, 0, 0}).array() + 1e9;
  RecordStatus(Case("status", "on a line, origin 1e9 m away", definition), "Degenerate", of(line));
  RecordStatus(Case("status", "one place", definition), "Degenerate", of(Points::Ones(3, 5)));
  Points bad = Cloud(&rng, 5, {1, 1, 1});
  for (const double value : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    bad(1, 3) = value;
    RecordStatus(Case("status", Format("a coordinate is %g", value), definition), "NonFiniteInput", of(bad));
  }
}

TEST(AlignmentDigits, SingularValues) {
  for (const double least : {1e-9, 1e-100, 1e-150}) {
    // Columns of lengths 1, sqrt(least) and least, turned: the values are known where the turn is exact, as a permutation is.
    Eigen::MatrixXd m = Eigen::MatrixXd::Zero(4, 3);
    m(1, 0) = 3, m(3, 1) = std::sqrt(least), m(0, 2) = least;
    const Eigen::VectorXd values = geometry::SingularValues(m);
    const double error =
        std::max({std::abs(values[0] / 3 - 1), std::abs(values[1] / std::sqrt(least) - 1), std::abs(values[2] / least - 1)});
    RecordDigits(Case("singular values", Format("from 3 to %g", least), "closed form"), 14, error);
  }
}

}  // namespace
}  // namespace mvstudio::geometry
