#include "triangulate/budget/shapley.h"

#include "core/check.h"

namespace mvstudio::triangulate {
namespace {

int CountBits(size_t set) {
  int count = 0;
  for (; set != 0; set &= set - 1) ++count;
  return count;
}

/// Part of the n! orders in which exactly the stages of a set of `size` come before a given one: size! (n - size - 1)! / n!.
double PartOfOrders(int size, int n) {
  double part = 1.0 / n;
  for (int i = 1; i <= size; ++i) part *= static_cast<double>(i) / (n - i);
  return part;
}

}  // namespace

std::vector<double> ShapleyShares(const std::vector<double>& error_of) {
  int n = 0;
  while ((size_t{1} << n) < error_of.size()) ++n;
  MVS_CHECK((size_t{1} << n) == error_of.size(), error_of.size() << " sets of stages");
  std::vector<double> shares(static_cast<size_t>(n));
  for (size_t i = 0; i < shares.size(); ++i) {
    for (size_t set = 0; set < error_of.size(); ++set) {
      if (set >> i & 1) continue;
      shares[i] += PartOfOrders(CountBits(set), n) * (error_of[set] - error_of[set | size_t{1} << i]);
    }
  }
  return shares;
}

}  // namespace mvstudio::triangulate
