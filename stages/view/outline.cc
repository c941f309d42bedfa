#include "stages/view/outline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/check.h"

namespace mvstudio::stages {
namespace {

constexpr int kForeground = 127;
constexpr std::array<std::pair<int, int>, 4> kSteps = {{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};  // right, down, left, up

/// Edges between foreground and background, the foreground on their right hand: a bit for each direction that leaves a corner
/// of the pixels' grid. Every corner is left as often as it is reached, so that lines close.
class BorderEdges {
 public:
  explicit BorderEdges(const Image& mask)
      : width_(mask.width + 1), height_(mask.height + 1), leaving_(static_cast<size_t>(width_) * static_cast<size_t>(height_)) {
    const auto inside = [&](int x, int y) {
      return x >= 0 && y >= 0 && x < mask.width && y<mask.height&& * mask.Pixel(x, y)> kForeground;
    };
    for (int y = 0; y < mask.height; ++y) {
      for (int x = 0; x < mask.width; ++x) {
        if (!inside(x, y)) continue;
        if (!inside(x, y - 1)) At(x, y) |= 1;
        if (!inside(x + 1, y)) At(x + 1, y) |= 2;
        if (!inside(x, y + 1)) At(x + 1, y + 1) |= 4;
        if (!inside(x - 1, y)) At(x, y + 1) |= 8;
      }
    }
  }

  /// The line from a corner, whose edges are taken away; empty where none leaves it.
  OutlinePx Take(int x, int y) {
    OutlinePx line;
    const int begin_x = x, begin_y = y;
    for (int before = -1; At(x, y) != 0;) {
      int turn = before < 0 ? 0 : (before + 1) % 4;  // to the right first: pixels that touch at a corner are apart
      while ((At(x, y) & (1 << turn)) == 0) turn = (turn + 3) % 4;
      At(x, y) = static_cast<uint8_t>(At(x, y) & ~(1 << turn));
      if (turn != before) line.emplace_back(x - 0.5, y - 0.5);
      before = turn, x += kSteps[static_cast<size_t>(turn)].first, y += kSteps[static_cast<size_t>(turn)].second;
      if (x == begin_x && y == begin_y) break;
    }
    return line;
  }

  int width() const { return width_; }
  int height() const { return height_; }

 private:
  uint8_t& At(int x, int y) { return leaving_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)]; }

  int width_, height_;
  std::vector<uint8_t> leaving_;
};

double DistanceToSegment(const Eigen::Vector2d& p, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d along = b - a;
  const double length2 = along.squaredNorm();
  const double share = length2 > 0 ? std::clamp((p - a).dot(along) / length2, 0.0, 1.0) : 0;
  return (p - a - share * along).norm();
}

/// Of a closed line, whose first corner and the one farthest from it stay.
OutlinePx Simplified(const OutlinePx& line, double tolerance_px) {
  const size_t n = line.size();
  size_t far = 0;
  for (size_t i = 1; i < n; ++i) {
    if ((line[i] - line[0]).squaredNorm() > (line[far] - line[0]).squaredNorm()) far = i;
  }
  std::vector<bool> stays(n, false);
  stays[0] = stays[far] = true;
  std::vector<std::pair<size_t, size_t>> parts = {{0, far}, {far, n}};  // n is the first corner again
  while (!parts.empty()) {
    const auto [first, last] = parts.back();
    parts.pop_back();
    size_t worst = first;
    double distance = tolerance_px;
    for (size_t i = first + 1; i < last; ++i) {
      const double d = DistanceToSegment(line[i], line[first], line[last % n]);
      if (d > distance) distance = d, worst = i;
    }
    if (worst == first) continue;
    stays[worst] = true;
    parts.emplace_back(first, worst), parts.emplace_back(worst, last);
  }
  OutlinePx kept;
  for (size_t i = 0; i < n; ++i) {
    if (stays[i]) kept.push_back(line[i]);
  }
  return kept;
}

/// Twice the area of a, b, p; its sign says on which side of the line p lies.
double SideOf(const Eigen::Vector2d& a, const Eigen::Vector2d& b, double x, double y) {
  return (b.x() - a.x()) * (y - a.y()) - (b.y() - a.y()) * (x - a.x());
}

void FillTriangle(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c, Image* mask) {
  const Eigen::Vector2d low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
  if (!low.allFinite() || !high.allFinite() || high.x() < 0 || high.y() < 0 || low.x() > mask->width || low.y() > mask->height)
    return;
  const int x0 = static_cast<int>(std::ceil(std::max(0.0, low.x()))),
            x1 = static_cast<int>(std::floor(std::min(mask->width - 1.0, high.x()))),
            y0 = static_cast<int>(std::ceil(std::max(0.0, low.y()))),
            y1 = static_cast<int>(std::floor(std::min(mask->height - 1.0, high.y())));
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const double u = SideOf(a, b, x, y), v = SideOf(b, c, x, y), w = SideOf(c, a, x, y);
      if ((u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0)) *mask->Pixel(x, y) = 255;
    }
  }
}

}  // namespace

std::vector<OutlinePx> OutlinesOf(const Image& mask, double tolerance_px) {
  if (mask.empty()) return {};
  MVS_CHECK(mask.channels == 1, "a mask of " << mask.channels << " channels");
  BorderEdges edges(mask);
  std::vector<OutlinePx> lines;
  for (int y = 0; y < edges.height(); ++y) {
    for (int x = 0; x < edges.width(); ++x) {
      for (OutlinePx line = edges.Take(x, y); !line.empty(); line = edges.Take(x, y)) {
        OutlinePx kept = Simplified(line, tolerance_px);
        if (kept.size() > 2) lines.push_back(std::move(kept));
      }
    }
  }
  return lines;
}

Image TriangleMask(const Eigen::Matrix2Xd& px, const Eigen::Matrix3Xi& faces, int width, int height) {
  Image mask(width, height, 1);
  for (Eigen::Index f = 0; f < faces.cols(); ++f)
    FillTriangle(px.col(faces(0, f)), px.col(faces(1, f)), px.col(faces(2, f)), &mask);
  return mask;
}

}  // namespace mvstudio::stages
