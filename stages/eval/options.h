#pragma once

#include <string>

#include "calib/check/rig_check.h"
#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "stages/input/calib_read.h"
#include "stages/input/corner_input.h"
#include "stages/input/session_input.h"

/// A calibration against new footage of a board: what a caller gives.
namespace mvstudio::stages {

struct EvalOptions {
  std::string calibration;  ///< empty: that of the session
  CornerArguments corners;
  SessionArguments session;
  std::string repair;  ///< file for the calibration with the new poses of cameras that moved; empty: none
  std::string out;     ///< folder that keeps the check; empty: none
  calib::RigCheckOptions check;
  CalibReadOptions read;
};

/// Without the calibration and how it is read.
template <class Visitor>
void VisitFields(Visitor&& visit, EvalOptions& o) {
  VisitFields(visit, o.corners);
  VisitSession(visit, o.session, "calibration, board and footage", "a board");
  StartGroup(visit, "Output");
  VisitStyled(visit, OptionStyle::kFile, "repair", o.repair,
              "write the calibration with the new poses of the cameras that have moved");
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out, "folder that keeps the check, for mvstudio report");
  StartGroup(visit, "Limits");
  VisitFields(visit, o.check);
}

}  // namespace mvstudio::stages
