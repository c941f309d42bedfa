#include "geometry/solve/signed_area.h"

#include <array>
#include <cmath>

namespace mvstudio::geometry::internal {
namespace {

/// Numbers whose sum is exact; each is smaller than the last bit of the next that is not zero.
struct Expansion {
  std::array<double, 12> parts{};
  size_t count = 0;

  /// Grow-Expansion of the paper, by its Two-Sum.
  void Add(double value) {
    double sum = value;
    for (size_t i = 0; i < count; ++i) {
      const double a = sum, b = parts[i];
      sum = a + b;
      const double b_virtual = sum - a;
      parts[i] = (a - (sum - b_virtual)) + (b - b_virtual);
    }
    parts[count++] = sum;
  }
  void AddProduct(double a, double b) {
    const double product = a * b;
    Add(std::fma(a, b, -product));
    Add(product);
  }
  double Sum() const {
    double sum = 0;
    for (size_t i = 0; i < count; ++i) sum += parts[i];
    return sum;
  }
};

}  // namespace

double ExactSignedArea2(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  Expansion sum;
  sum.AddProduct(a[0], b[1]), sum.AddProduct(-a[1], b[0]);
  sum.AddProduct(b[0], c[1]), sum.AddProduct(-b[1], c[0]);
  sum.AddProduct(c[0], a[1]), sum.AddProduct(-c[1], a[0]);
  return sum.Sum();
}

}  // namespace mvstudio::geometry::internal
