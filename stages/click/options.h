#pragma once

#include <string>
#include <vector>

#include "calib/points/point_resection.h"
#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "stages/input/session_input.h"
#include "stages/words.h"

/// Points that are clicked in the cameras' images: what a caller gives.
namespace mvstudio::stages {

struct ClickOptions {
  std::string points;  ///< CSV name,x,y,z (metres), or names alone
  std::vector<NamedPath> cameras;
  std::string calib;  ///< empty: that of the session, or none
  int frame = 0;
  std::string out;  ///< table of clicks; empty: in the session
  int port = 0;     ///< of the page; 0: any that is free
  calib::PointResectionOptions resection;
  SessionArguments session;
};

template <class Visitor>
void VisitFields(Visitor&& visit, ClickOptions& o) {
  visit("points", o.points, "CSV name,x,y,z (metres), or names alone: the points, in the order in which they are offered");
  VisitStyled(visit, OptionStyle::kRepeated, "camera", o.cameras,
              "NAME=PATH: an image, a video, a folder or a pattern in quotes; repeat for each camera");
  visit("calib", o.calib, "calibration with the cameras' lenses: residuals are shown while you click");
  visit("frame", o.frame, "number of the frame or image that is shown, or the next one");
  VisitStyled(visit, OptionStyle::kFile, "out", o.out,
              "table camera,point,x_px,y_px, saved after each click and gone on with when it is there; "
              "SESSION/calib/clicks.csv unless given");
  visit("port", o.port, "port on 127.0.0.1; 0: any that is free");
  visit("click-sigma-px", o.resection.click_sigma_px, "px; how well you click, per coordinate");
  VisitSession(visit, o.session, "footage and calibration", "people");
}

}  // namespace mvstudio::stages
