#include "dataset/markers/fill.h"

#include <optional>

namespace mvstudio::markers {
namespace {

using Eigen::Vector3d;

/// One marker over time.
class Curve {
 public:
  Curve(MarkerTake* take, int marker) : take_(take), marker_(marker) {}

  bool Has(int f) const {
    return f >= 0 && f < take_->num_frames() && take_->source[take_->Index(f, marker_)] != Source::kMissing;
  }
  const Vector3d& At(int f) const { return take_->x_in_world[take_->Index(f, marker_)]; }
  void Fill(int f, const Vector3d& x_in_world) {
    const size_t i = take_->Index(f, marker_);
    take_->x_in_world[i] = x_in_world, take_->source[i] = Source::kFilled, take_->sigma_m[i] = 0;
  }

 private:
  MarkerTake* take_;
  int marker_;
};

/// Slope at `f`, per frame, of the parabola through it, the position `step` frames on and the far end of the gap.
Vector3d Slope(const Curve& curve, int f, int step, int far) {
  const Vector3d chord = (curve.At(far) - curve.At(f)) / (far - f);
  if (!curve.Has(f + step)) return chord;
  const Vector3d own = (curve.At(f + step) - curve.At(f)) / step;
  return own + (chord - own) * (-step) / (far - f - step);
}

/// Positions between the frames `a` and `b`.
void FillBetween(int a, int b, Curve* curve) {
  const double span = b - a;
  const Vector3d from = curve->At(a), to = curve->At(b);
  const Vector3d leave = span * Slope(*curve, a, -1, b), arrive = span * Slope(*curve, b, 1, a);
  for (int f = a + 1; f < b; ++f) {
    const double t = (f - a) / span, s = 1 - t;
    curve->Fill(f, s * s * (1 + 2 * t) * from + t * t * (3 - 2 * t) * to + t * s * s * leave - t * t * s * arrive);
  }
}

}  // namespace

FillReport FillGaps(int most_frames, MarkerTake* take) {
  FillReport report;
  for (int m = 0; m < take->num_markers(); ++m) {
    Curve curve(take, m);
    std::optional<int> last;
    for (int f = 0; f < take->num_frames(); ++f) {
      if (!curve.Has(f)) continue;
      const int gap = last ? f - *last - 1 : 0;
      if (gap > 0 && gap <= most_frames) {
        FillBetween(*last, f, &curve);
        ++report.num_gaps, report.num_positions += gap;
      } else {
        report.num_left += gap;
      }
      last = f;
    }
  }
  return report;
}

}  // namespace mvstudio::markers
