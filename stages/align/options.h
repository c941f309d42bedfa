#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "calib/points/point_resection.h"
#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "stages/calib/stated_lengths.h"
#include "stages/input/calib_read.h"
#include "stages/input/corner_input.h"
#include "stages/input/session_input.h"

/// A calibrated rig in another world: what a caller gives.
namespace mvstudio::stages {

struct AlignOptions {
  std::string calibration;
  int64_t floor_board = -1;          ///< frame in which the board lies on the floor; -1: none
  std::string floor_joints;          ///< 3D joints of people who walk on the floor; empty: none
  std::vector<std::string> points;   ///< tables of points in both worlds, or of their marks; with `lengths` a take as well
  std::vector<std::string> lengths;  ///< see calib/points/stated_length.h
  std::string marker_unit;           ///< of joints in a file of another program; empty: its own
  bool scale = false;                ///< `points` without `lengths`: the rig's size changes as well
  std::string out;                   ///< file
  SessionArguments session;
  CornerArguments corners;
  calib::PointResectionOptions clicks;
  CalibReadOptions read;
};

/// Without the calibration and how it is read.
template <class Visitor>
void VisitFields(Visitor&& visit, AlignOptions& o) {
  constexpr char kSubject[] = "World and size";
  StartGroup(visit, kSubject);
  VisitStyled(visit, OptionStyle::kUnset, "floor-board", o.floor_board,
              "frame in which the board lies on the floor: z up, x along its columns, origin at its first corner");
  visit("floor-joints", o.floor_joints,
        "3D joints, a folder of triangulate: the floor is the plane on which people's feet stand");
  visit("points", o.points,
        "CSV point,x,y,z,x_old,y_old,z_old (metres): points in both worlds; or as option 'scene-points' of calibrate: "
        "point,x,y,z and camera,point,x_px,y_px, in one file or two");
  visit("length", o.lengths, std::string(kLengthHelp) + "; option 'points' is then the take, a folder or table of triangulate");
  visit("marker-unit", o.marker_unit,
        "m, cm, mm, in or the length of one unit, e.g. 25mm: of joints in a file of another program");
  VisitStyled(visit, OptionStyle::kSwitch, "scale", o.scale, "option 'points': also change the rig's scale");
  VisitStyled(visit, OptionStyle::kFile, "out", o.out, "file to write");
  VisitSession(visit, o.session, "board and footage", "a board");
  VisitFields(visit, o.corners);
  StartGroup(visit, kSubject);
  visit("click-sigma-px", o.clicks.click_sigma_px, "px; expected standard deviation of a marked point, per coordinate");
}

}  // namespace mvstudio::stages
