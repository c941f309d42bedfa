// Private: where the names of points stand, for the figures of this folder.
#pragma once

#include <string>
#include <vector>

#include "report/svg/canvas.h"

namespace mvstudio::report {

/// A name that should stand beside its point.
struct PointLabel {
  SvgCanvas::Point point;
  std::string text;
  double direction_rad = 0;  ///< where it would like to stand, seen from the point; x right, y down
};

/// Draws names of 10.5 px beside their points, clear of each other, of all these points and of the figure's edges where there
/// is room; a line leads to those that stand apart.
void DrawPointLabels(SvgCanvas* canvas, const std::vector<PointLabel>& labels, double top, double bottom);

}  // namespace mvstudio::report
