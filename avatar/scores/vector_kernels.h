#pragma once

#include <cstdint>

namespace mvstudio::avatar {

/// `count` vectors, `stride` elements from one to the next.
struct Vectors {
  const double* first;
  int64_t stride, count;
};

/// out[k] = vector k times v; both have `length` elements.
void Dots(const Vectors& vectors, const double* v, int64_t length, double* out);
/// out -= sum of weights[k] vector k.
void SubtractCombination(const Vectors& vectors, const double* weights, int64_t length, double* out);

}  // namespace mvstudio::avatar
