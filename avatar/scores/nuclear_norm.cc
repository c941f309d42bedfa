#include "avatar/scores/nuclear_norm.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "avatar/scores/vector_kernels.h"
#include "core/check.h"
#include "core/error.h"

namespace mvstudio::avatar {
namespace {

/// Columns whose two products are taken while they lie in the cache, columns of one thread's task, steps of a panel, and the
/// elements of a cache line.
constexpr int64_t kColumnsAtATime = 8, kColumnsATask = 256, kPanel = 8, kAlign = 8;

/// H = I - scale v v^T with v[0] = 1 takes a vector to (value, 0, 0, ...).
struct Reflection {
  double scale = 0, value = 0;
};

/// The reflection of x; v is left in its place.
Reflection Reflect(double* x, int64_t n) {
  double squares = 0;
  for (int64_t i = 1; i < n; ++i) squares += x[i] * x[i];
  const double first = x[0];
  x[0] = 1;
  if (squares == 0) return {0, first};
  const double value = -std::copysign(std::sqrt(first * first + squares), first);
  for (int64_t i = 1; i < n; ++i) x[i] /= first - value;
  return {(value - first) / value, value};
}

/// A matrix by columns, from which left^T right, the outer products of the panel's reflections, has yet to be taken.
class Reduction {
 public:
  explicit Reduction(const at::Tensor& m)
      : rows_(m.size(0)),
        columns_(m.size(1)),
        stride_(((rows_ + kAlign - 1) / kAlign | 1) * kAlign),  // odd cache lines, or columns would share the cache's sets
        matrix_(at::zeros({columns_, stride_}, at::kDouble)),
        left_(at::zeros({2 * kPanel, stride_}, at::kDouble)),
        right_(at::zeros({2 * kPanel, columns_}, at::kDouble)),
        row_(columns_) {
    matrix_.slice(1, 0, rows_).copy_(m.t());
  }

  Bidiagonal Run() {
    Bidiagonal b;
    for (int64_t j = 0; j < columns_; ++j) {
      const Reflection column = ReflectColumn(j);
      b.diagonal.push_back(column.value);
      if (j + 1 == columns_) break;
      b.above.push_back(ReflectRow(j, column.scale));
      if (pending_ == 2 * kPanel) Update(j + 1);
    }
    return b;
  }

 private:
  double* Column(int64_t j) { return matrix_.data_ptr<double>() + j * stride_; }
  double* Left(int64_t k) { return left_.data_ptr<double>() + k * stride_; }
  double* Right(int64_t k) { return right_.data_ptr<double>() + k * columns_; }
  /// The first `count` of them, from row or column `first` on.
  Vectors Lefts(int64_t first, int64_t count) { return {Left(0) + first, stride_, count}; }
  Vectors Rights(int64_t first, int64_t count) { return {Right(0) + first, columns_, count}; }

  /// Column j as it is by now, reflected; the vector becomes the next of left_.
  Reflection ReflectColumn(int64_t j) {
    double *v = Left(pending_), weights[2 * kPanel];
    std::fill(v, v + j, 0.0);
    std::copy(Column(j) + j, Column(j) + rows_, v + j);
    for (int64_t k = 0; k < pending_; ++k) weights[k] = Right(k)[j];
    SubtractCombination(Lefts(j, pending_), weights, rows_ - j, v + j);
    return Reflect(v + j, rows_ - j);
  }

  /// Row j right of the diagonal, behind the reflection of column j with its `scale`, reflected in turn. Both reflections
  /// become pending. Returns the element that is left of the row.
  double ReflectRow(int64_t j, double scale) {
    const int64_t first = j + 1, n = columns_ - first;
    double *v = Left(pending_), *y = Right(pending_), *u = Right(pending_ + 1), *r = row_.data(), weights[2 * kPanel];
    for (int64_t c = first; c < columns_; ++c) r[c] = Column(c)[j];
    for (int64_t k = 0; k < pending_; ++k) weights[k] = Left(k)[j];
    SubtractCombination(Rights(first, pending_), weights, n, r + first);
    Dots(Lefts(j, pending_), v + j, rows_ - j, weights);
    std::fill_n(y + first, n, 0.0);
    SubtractCombination(Rights(first, pending_), weights, n, y + first);
    MultiplyBoth(j, scale);
    std::copy(r + first, r + columns_, u + first);
    const Reflection row = Reflect(u + first, n);
    FinishRow(first, row);
    pending_ += 2;
    return row.value;
  }

  /// One pass over the columns right of j, for the pair (v, y) and the vector x to come:
  /// y = scale (y + A^T v), r -= y, x = -A r.
  void MultiplyBoth(int64_t j, double scale) {
    const int64_t first = j + 1, tasks = (columns_ - first + kColumnsATask - 1) / kColumnsATask;
    const int64_t top = j / kAlign * kAlign, m = rows_ - top;  // v is zero above row j, and nobody reads x there
    double *v = Left(pending_), *x = Left(pending_ + 1), *y = Right(pending_), *r = row_.data();
    partial_.assign(tasks * m, 0.0);
    at::parallel_for(0, tasks, 1, [&](int64_t begin, int64_t end) {
      for (int64_t c = first + begin * kColumnsATask; c < std::min(columns_, first + end * kColumnsATask);
           c += kColumnsAtATime) {
        const Vectors some{Column(c) + top, stride_, std::min(kColumnsAtATime, columns_ - c)};
        double products[kColumnsAtATime];
        Dots(some, v + top, m, products);
        for (int64_t k = 0; k < some.count; ++k) y[c + k] = scale * (y[c + k] + products[k]), r[c + k] -= y[c + k];
        SubtractCombination(some, r + c, m, partial_.data() + (c - first) / kColumnsATask * m);
      }
    });
    std::fill_n(x + top, m, 0.0);
    const std::vector<double> minus(tasks, -1.0);
    SubtractCombination({partial_.data(), m, tasks}, minus.data(), m, x + top);
  }

  /// x = row.scale (A - left^T right) u. So far x is -A r, and u is r but for its first element and its scale.
  void FinishRow(int64_t first, const Reflection& row) {
    double *x = Left(pending_ + 1), *u = Right(pending_ + 1), weights[2 * kPanel];
    const int64_t m = rows_ - first, n = columns_ - first;
    if (row.scale == 0) {
      std::fill_n(x + first, m, 0.0);
      return;
    }
    const double* a = Column(first);
    const double scale = 1 / (row.value - row_[first]);
    for (int64_t i = first; i < rows_; ++i) x[i] = (x[i] + row.value * a[i]) * scale;
    Dots(Rights(first, pending_ + 1), u + first, n, weights);
    SubtractCombination(Lefts(first, pending_ + 1), weights, m, x + first);
    for (int64_t i = first; i < rows_; ++i) x[i] *= row.scale;
  }

  void Update(int64_t first) {
    matrix_.slice(0, first).slice(1, first, rows_).addmm_(right_.slice(1, first).t(), left_.slice(1, first, rows_), 1, -1);
    pending_ = 0;
  }

  int64_t rows_, columns_, stride_, pending_ = 0;
  at::Tensor matrix_, left_, right_;  // (columns, stride); (2 kPanel, stride), (2 kPanel, columns): v, x and y, u by turns
  std::vector<double> row_, partial_;
};

struct Rotation {
  double c, s, r;
};
/// [c s; -s c] (f, g)^T = (r, 0)^T.
Rotation Rotate(double f, double g) {
  const double r = std::sqrt(f * f + g * g);
  return r == 0 ? Rotation{1, 0, f} : Rotation{f / r, g / r, r};
}

/// The smaller singular value of [f g; 0 h].
double SmallerSingularValue(double f, double g, double h) {
  const double product = std::fabs(f * h), gap = std::fabs(f) - std::fabs(h), sum = std::fabs(f) + std::fabs(h);
  const double divisor = std::sqrt(sum * sum + g * g) + std::sqrt(gap * gap + g * g);
  return divisor == 0 ? 0 : 2 * product / divisor;
}

/// One sweep over the block that begins at d and has n values. Keeps small values small; no shift.
void SweepWithoutShift(double* d, double* e, int64_t n) {
  Rotation right{1, 0, 0}, left{1, 0, 0};
  for (int64_t i = 0; i + 1 < n; ++i) {
    right = Rotate(d[i] * right.c, e[i]);
    if (i > 0) e[i - 1] = left.s * right.r;
    left = Rotate(left.c * right.r, d[i + 1] * right.s);
    d[i] = left.r;
  }
  const double last = d[n - 1] * right.c;
  e[n - 2] = last * left.s;
  d[n - 1] = last * left.c;
}

void Sweep(double* d, double* e, int64_t n, double shift) {
  double f = (std::fabs(d[0]) - shift) * (std::copysign(1.0, d[0]) + shift / d[0]), g = e[0];
  for (int64_t i = 0; i + 1 < n; ++i) {
    const Rotation right = Rotate(f, g);
    if (i > 0) e[i - 1] = right.r;
    f = right.c * d[i] + right.s * e[i];
    e[i] = right.c * e[i] - right.s * d[i];
    const Rotation left = Rotate(f, right.s * d[i + 1]);
    d[i + 1] *= right.c;
    d[i] = left.r;
    f = left.c * e[i] + left.s * d[i + 1];
    d[i + 1] = left.c * d[i + 1] - left.s * e[i];
    if (i + 2 < n) g = left.s * e[i + 1], e[i + 1] *= left.c;
  }
  e[n - 2] = f;
}

/// A step towards the last value of a block; `least`: what counts as zero.
void QrStep(double* d, double* e, int64_t n, double least) {
  const double shift = SmallerSingularValue(d[n - 2], e[n - 2], d[n - 1]);
  const bool singular = std::any_of(d, d + n, [&](double x) { return std::fabs(x) <= least; });
  if (singular || shift <= least) {
    SweepWithoutShift(d, e, n);
  } else {
    Sweep(d, e, n, shift);
  }
}

}  // namespace

Bidiagonal Bidiagonalise(const at::Tensor& m) {
  MVS_CHECK(m.dim() == 2 && m.scalar_type() == at::kDouble && m.size(0) >= m.size(1) && m.size(1) > 0, "not a tall matrix");
  return Reduction(m).Run();
}

double SumOfSingularValues(Bidiagonal b) {
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon() / 2;
  double *d = b.diagonal.data(), *e = b.above.data(), largest = 0, sum = 0;
  for (const auto* part : {&b.diagonal, &b.above}) {
    for (const double x : *part) largest = std::max(largest, std::fabs(x));
  }
  const auto negligible = [&](int64_t i) {
    return std::fabs(e[i]) <= kEpsilon * std::max(std::fabs(d[i]) + std::fabs(d[i + 1]), largest / 16);
  };
  auto end = static_cast<int64_t>(b.diagonal.size());
  for (int64_t sweeps_left = 30 * end; end > 0; --sweeps_left) {
    if (end == 1 || negligible(end - 2)) {
      sum += std::fabs(d[--end]);
      continue;
    }
    if (sweeps_left <= 0) throw Error("the singular values of a bidiagonal matrix do not converge");
    int64_t begin = end - 2;
    while (begin > 0 && !negligible(begin - 1)) --begin;
    QrStep(d + begin, e + begin, end - begin, kEpsilon * largest);
  }
  return sum;
}

double NuclearNorm(const at::Tensor& m) {
  const auto [least, most] = at::aminmax(m);
  const double size = std::max(std::fabs(least.item<double>()), std::fabs(most.item<double>()));
  MVS_CHECK(std::isfinite(size), "a nuclear norm of NaN or infinity");
  if (size == 0) return 0;
  const at::Tensor tall = m.size(0) <= m.size(1) ? m.t() : m;  // a square one as it lies: columns are read at a stretch
  return size * SumOfSingularValues(Bidiagonalise(tall / size));
}

}  // namespace mvstudio::avatar
