#include "report/svg/labels.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace mvstudio::report {
namespace {

struct LabelBox {
  double left = 0, top = 0, right = 0, bottom = 0;
};

/// px squared
double Overlap(const LabelBox& a, const LabelBox& b) {
  const double width = std::min(a.right, b.right) - std::max(a.left, b.left);
  const double height = std::min(a.bottom, b.bottom) - std::max(a.top, b.top);
  return width > 0 && height > 0 ? width * height : 0;
}

struct LabelPlace {
  SvgCanvas::Point at;  ///< of the anchor, on the text's base line
  const char* anchor = "start";
  LabelBox box;
  double distance = 0;
};

LabelPlace PlaceAt(const PointLabel& label, double direction, double distance) {
  constexpr double kHalfHeight = 6;
  const double width = 0.875 * TextWidth(label.text), across = std::cos(direction);
  const double x = label.point.first + distance * across, y = label.point.second + distance * std::sin(direction);
  const double left = across > 0.4 ? x : across < -0.4 ? x - width : x - width / 2;
  return {{x, y + 4},
          across > 0.4    ? "start"
          : across < -0.4 ? "end"
                          : "middle",
          {left, y - kHalfHeight, left + width, y + kHalfHeight},
          distance};
}

/// Outside of the figure counts more than anything that could be covered.
double Cost(const LabelPlace& place, double turn, const std::vector<LabelBox>& taken, const LabelBox& figure) {
  const LabelBox& box = place.box;
  const double area = (box.right - box.left) * (box.bottom - box.top);
  double cost = 0.1 * place.distance + 0.5 * std::fabs(turn) + 10 * (area - Overlap(box, figure));
  for (const LabelBox& other : taken) cost += Overlap(box, other);
  return cost;
}

LabelPlace BestPlace(const PointLabel& label, const std::vector<LabelBox>& taken, const LabelBox& figure) {
  constexpr double kDistances[] = {10, 20, 32}, kTurns[] = {0, 0.5, -0.5, 1, -1, 1.6, -1.6, 2.3, -2.3, 3.14};
  LabelPlace best = PlaceAt(label, label.direction_rad, kDistances[0]);
  double least = std::numeric_limits<double>::infinity();
  for (const double distance : kDistances) {
    for (const double turn : kTurns) {
      const LabelPlace place = PlaceAt(label, label.direction_rad + turn, distance);
      const double cost = Cost(place, turn, taken, figure);
      if (cost < least) best = place, least = cost;
    }
  }
  return best;
}

}  // namespace

void DrawPointLabels(SvgCanvas* canvas, const std::vector<PointLabel>& labels, double top, double bottom) {
  constexpr double kPoint = 4, kBeside = 12;
  const LabelBox figure{0, top, canvas->width(), bottom};
  std::vector<LabelBox> taken;
  for (const PointLabel& label : labels) {
    const auto [x, y] = label.point;
    taken.push_back({x - kPoint, y - kPoint, x + kPoint, y + kPoint});
  }
  for (const PointLabel& label : labels) {
    const LabelPlace place = BestPlace(label, taken, figure);
    taken.push_back(place.box);
    if (place.distance > kBeside)
      canvas->Line(label.point.first, label.point.second, place.at.first, place.at.second - 4, "axis", 0.7);
    canvas->Text(place.at.first, place.at.second, label.text, place.anchor, "x halo");
  }
}

}  // namespace mvstudio::report
