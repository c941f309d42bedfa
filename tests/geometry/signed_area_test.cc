#include "geometry/solve/signed_area.h"

#include <boost/multiprecision/mpfr.hpp>
#include <cmath>

#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

using Eigen::Vector2d;
/// 400 digits: more than products of the differences below have.
using Mp400 = boost::multiprecision::number<boost::multiprecision::mpfr_float_backend<400>, boost::multiprecision::et_off>;

Mp400 Exact(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  const Mp400 ax(a[0]), ay(a[1]), bx(b[0]), by(b[1]), cx(c[0]), cy(c[1]);
  return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
}

/// The sign is exact, the size right to 1e-15 of the terms, and any order of the points tells the same.
void ExpectRight(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  const Mp400 exact = Exact(a, b, c);
  const double area = SignedArea2(a, b, c);
  EXPECT_EQ((area > 0) - (area < 0), exact.sign()) << a.transpose() << ", " << b.transpose() << ", " << c.transpose();
  const double size = (b - a).cwiseAbs().maxCoeff() * (c - a).cwiseAbs().maxCoeff();
  EXPECT_NEAR(area, exact.convert_to<double>(), 1e-15 * size);
  const auto sign = [](double value) { return (value > 0) - (value < 0); };
  EXPECT_EQ(sign(SignedArea2(b, c, a)), sign(area));
  EXPECT_EQ(sign(SignedArea2(b, a, c)), -sign(area));
}

TEST(SignedArea2, OfSimpleTriangles) {
  EXPECT_EQ(SignedArea2({0, 0}, {2, 0}, {0, 3}), 6);
  EXPECT_EQ(SignedArea2({0, 0}, {0, 3}, {2, 0}), -6);
  EXPECT_EQ(SignedArea2({1, 1}, {1, 1}, {5, 7}), 0);
  EXPECT_EQ(SignedArea2({0.1, 0.1}, {0.3, 0.3}, {0.7, 0.7}), 0);
  EXPECT_TRUE(std::isnan(SignedArea2({std::nan(""), 0}, {1, 0}, {0, 1})));
}

TEST(SignedArea2, SignNearALineIsExact) {
  Rng rng(1);
  int on_line = 0, plain_is_wrong = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vector2d a(rng.Uniform(-500, 500), rng.Uniform(-500, 500)), b(rng.Uniform(-500, 500), rng.Uniform(-500, 500));
    Vector2d c = a + rng.Uniform(-1, 2) * (b - a);
    const int steps = static_cast<int>(rng.Uniform(-3, 4));
    for (int k = 0; k < std::abs(steps); ++k) c[k % 2] = std::nextafter(c[k % 2], steps * 1e9);
    ExpectRight(a, b, c);
    const double plain = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    plain_is_wrong += plain * SignedArea2(a, b, c) < 0;
    on_line += SignedArea2(a, b, {0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])}) == 0;
  }
  EXPECT_GT(plain_is_wrong, 100) << "the test has hard cases";
  EXPECT_GT(on_line, 0);
}

TEST(SignedArea2, CoordinatesOfVeryDifferentSizes) {
  Rng rng(2);
  const auto any = [&] { return (rng.Uniform(0, 1) < 0.5 ? -1 : 1) * std::pow(10.0, rng.Uniform(-50, 50)); };
  for (int i = 0; i < 5000; ++i) {
    const Vector2d a(any(), any()), b(any(), any());
    ExpectRight(a, b, {any(), any()});
    ExpectRight(a, b, -2 * a);
    ExpectRight(a, -a, {0, std::nextafter(0.0, 1.0) + 1e-90});
  }
}

}  // namespace
}  // namespace mvstudio::geometry
