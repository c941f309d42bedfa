#pragma once

#include <string>

#include "core/choice/option_style.h"
#include "stages/input/calib_read.h"

/// Two calibrations of one rig: what a caller gives.
namespace mvstudio::stages {

struct CompareOptions {
  std::string rig, reference;  ///< files or folders
  std::string out;             ///< folder that keeps the comparison; empty: none
  std::string ranges_m = "1,3,inf";
  bool implied = true;
  double focus = 1;  ///< share of the image's half diagonal
  int grid = 24;     ///< points across the image
  double max_rotation_deg = 0, max_translation_mm = 0, max_focal_percent = 0, max_lens_px = 0, max_projection_px = 0;
  CalibReadOptions read;
};

/// Without the calibrations and how they are read.
template <class Visitor>
void VisitFields(Visitor&& visit, CompareOptions& o) {
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out, "folder that keeps the comparison, for mvstudio report");
  visit("range-m", o.ranges_m, "distances at which projections are compared, metres, with commas");
  visit("implied", o.implied,
        "take out the small motion between the two camera frames that explains most of the projection difference");
  visit("focus", o.focus, "share of the image's half diagonal, around its centre, in which that motion is fitted");
  visit("grid", o.grid, "points across the image at which projections are compared");
  visit("max-rotation-deg", o.max_rotation_deg, "exit 4 when a camera differs more; 0: no limit");
  visit("max-translation-mm", o.max_translation_mm, "exit 4 when a camera differs more; 0: no limit");
  visit("max-focal-percent", o.max_focal_percent, "exit 4 when a focal length differs more; 0: no limit");
  visit("max-lens-px", o.max_lens_px, "exit 4 when a ray's pixels through both lenses lie farther apart; 0: no limit");
  visit("max-projection-px", o.max_projection_px,
        "exit 4 when the projection difference (rms over the image, any range) is larger; 0: no limit");
}

}  // namespace mvstudio::stages
