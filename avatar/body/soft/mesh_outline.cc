#include "avatar/body/soft/mesh_outline.h"

#include <algorithm>
#include <cmath>

#include "geometry/solve/signed_area.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector2d;

constexpr double kFarthestPx = 1e9;

/// A place beside a triangle's edge.
struct Side {
  int a, b;   // a < b
  bool left;  // the face's third vertex lies where signed areas are positive
};

struct Window {
  Vector2d low, high;
};

/// The faces that cover a point, by cells of the window.
class FaceCells {
 public:
  FaceCells(const Eigen::Matrix3Xi& faces, const std::vector<int>& used, const Eigen::Matrix2Xd& px, const Window& window)
      : faces_(faces), px_(px), window_(window) {
    const Vector2d size = (window.high - window.low) / kCellPx;
    columns_ = static_cast<int>(size[0]) + 1, rows_ = static_cast<int>(size[1]) + 1;
    cells_.resize(static_cast<size_t>(columns_) * rows_);
    for (const int f : used) Add(f);
  }

  bool Covers(const Vector2d& at) const {
    const Vector2d cell = (at - window_.low) / kCellPx;
    if (!(cell.minCoeff() >= 0 && cell[0] < columns_ && cell[1] < rows_)) return false;
    const auto& list = cells_[static_cast<size_t>(cell[1]) * columns_ + static_cast<size_t>(cell[0])];
    return std::any_of(list.begin(), list.end(), [&](int f) { return Inside(f, at); });
  }

 private:
  static constexpr double kCellPx = 4;

  bool Inside(int f, const Vector2d& at) const {
    const Vector2d a = px_.col(faces_(0, f)), b = px_.col(faces_(1, f)), c = px_.col(faces_(2, f));
    const double u = geometry::SignedArea2(b, c, at), v = geometry::SignedArea2(c, a, at), w = geometry::SignedArea2(a, b, at);
    return (u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0);
  }

  int Cell(double at, double low, int count) const {
    return static_cast<int>(std::clamp((at - low) / kCellPx, 0.0, count - 1.0));
  }

  void Add(int f) {
    const Vector2d a = px_.col(faces_(0, f)), b = px_.col(faces_(1, f)), c = px_.col(faces_(2, f));
    const Vector2d low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
    if ((high.array() < window_.low.array()).any() || (low.array() > window_.high.array()).any()) return;
    const int x1 = Cell(high[0], window_.low[0], columns_), y1 = Cell(high[1], window_.low[1], rows_);
    for (int y = Cell(low[1], window_.low[1], rows_); y <= y1; ++y) {
      for (int x = Cell(low[0], window_.low[0], columns_); x <= x1; ++x)
        cells_[static_cast<size_t>(y) * columns_ + x].push_back(f);
    }
  }

  const Eigen::Matrix3Xi& faces_;
  const Eigen::Matrix2Xd& px_;
  Window window_;
  int columns_ = 0, rows_ = 0;
  std::vector<std::vector<int>> cells_;
};

std::vector<Side> SidesOf(const Eigen::Matrix3Xi& faces, const std::vector<int>& used, const Eigen::Matrix2Xd& px) {
  std::vector<Side> sides;
  sides.reserve(3 * used.size());
  for (const int f : used) {
    const bool positive = geometry::SignedArea2(px.col(faces(0, f)), px.col(faces(1, f)), px.col(faces(2, f))) > 0;
    for (int k = 0; k < 3; ++k) {
      const int a = faces(k, f), b = faces((k + 1) % 3, f);
      sides.push_back({std::min(a, b), std::max(a, b), (a < b) == positive});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& x, const Side& y) {
    return x.a != y.a ? x.a < y.a : x.b != y.b ? x.b < y.b : x.left < y.left;
  });
  return sides;
}

/// The part of a + t (b - a), t in [0, 1], in the window (Liang and Barsky, "A new concept and method for line clipping",
/// 1984).
bool Clip(const Vector2d& a, const Vector2d& b, const Window& window, double* first, double* last) {
  *first = 0, *last = 1;
  for (int i = 0; i < 2; ++i) {
    const double step = b[i] - a[i], to_low = window.low[i] - a[i], to_high = window.high[i] - a[i];
    if (step == 0) {
      if (to_low > 0 || to_high < 0) return false;
      continue;
    }
    *first = std::max(*first, std::min(to_low / step, to_high / step));
    *last = std::min(*last, std::max(to_low / step, to_high / step));
  }
  return *first < *last;
}

/// Pieces of an edge that bounds what all its faces cover.
void AddPieces(const Side& side, const Eigen::Matrix2Xd& px, const FaceCells& cells, const Window& window,
               std::vector<OutlinePiece>* pieces) {
  constexpr double kBesidePx = 1e-3;
  const Vector2d a = px.col(side.a), b = px.col(side.b);
  double first, last;
  if (!Clip(a, b, window, &first, &last)) return;
  const double length = (b - a).norm();
  const Vector2d right = Vector2d(b[1] - a[1], a[0] - b[0]) / length;  // signed areas are negative there
  const Vector2d beside = (side.left ? kBesidePx : -kBesidePx) * right;
  const int count = std::max(1, static_cast<int>(std::ceil((last - first) * length)));
  for (int i = 0; i < count; ++i) {
    const double t0 = first + (last - first) * i / count, t1 = first + (last - first) * (i + 1) / count;
    if (!cells.Covers(a + (t0 + t1) / 2 * (b - a) + beside)) pieces->push_back({side.a, side.b, t0, t1});
  }
}

/// Faces with an area in the image.
std::vector<int> UsedFaces(const Eigen::Matrix3Xi& faces, const ScreenVertices& screen) {
  std::vector<int> used;
  const auto good = [&](int v) { return screen.seen[v] && screen.px.col(v).cwiseAbs().maxCoeff() < kFarthestPx; };
  for (Eigen::Index f = 0; f < faces.cols(); ++f) {
    const int a = faces(0, f), b = faces(1, f), c = faces(2, f);
    if (!good(a) || !good(b) || !good(c)) continue;
    if (geometry::SignedArea2(screen.px.col(a), screen.px.col(b), screen.px.col(c)) != 0) used.push_back(static_cast<int>(f));
  }
  return used;
}

}  // namespace

MeshOutline FindOutline(const Eigen::Matrix3Xi& faces, const ScreenVertices& screen, int width_px, int height_px,
                        double margin_px) {
  MeshOutline outline;
  const std::vector<int> used = UsedFaces(faces, screen);
  outline.skipped_faces = static_cast<int>(faces.cols() - static_cast<Eigen::Index>(used.size()));
  const Window window{Vector2d::Constant(-margin_px), Vector2d(width_px - 1 + margin_px, height_px - 1 + margin_px)};
  const FaceCells cells(faces, used, screen.px, window);
  const std::vector<Side> sides = SidesOf(faces, used, screen.px);
  for (size_t i = 0, next; i < sides.size(); i = next) {
    for (next = i; next < sides.size() && sides[next].a == sides[i].a && sides[next].b == sides[i].b;) ++next;
    if (sides[i].left == sides[next - 1].left) AddPieces(sides[i], screen.px, cells, window, &outline.pieces);
  }
  return outline;
}

}  // namespace mvstudio::body
