#pragma once

#include <set>
#include <string>
#include <vector>

#include "calib/calibrate_options.h"
#include "calib/points/from_scene.h"
#include "calib/points/point_resection.h"
#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "stages/budget/ask.h"
#include "stages/input/corner_input.h"
#include "stages/input/session_input.h"

/// Cameras -> calibration: what a caller gives.
namespace mvstudio::stages {

/// Without footage of a board: marked points, or the scene itself.
struct SceneOptions {
  std::string from_scene;                 ///< folder or pattern of images, one a camera, named by the camera
  std::vector<std::string> scene_points;  ///< one or two CSV files
  std::string camera_distance;            ///< "A:B:1.234m"
  std::vector<std::string> lengths;       ///< of marks without places, see calib/points/stated_length.h
  bool rigid = false;                     ///< scene points: CalibrateOptions::start is a rig that keeps its relative poses
  calib::PointResectionOptions points;
  calib::FromSceneOptions scene;
};

template <class Visitor>
void VisitFields(Visitor&& visit, SceneOptions& o) {
  StartGroup(visit, "Without a board");
  visit("from-scene", o.from_scene,
        "images of the empty scene, one for each camera and named by it: a folder or a pattern in quotes");
  visit("scene-points", o.scene_points,
        "CSV camera,point,x_px,y_px and CSV point,x,y,z (metres), in one file or two: marks with known places; with option "
        "'length' the clicks suffice");
  visit("length", o.lengths,
        "option 'scene-points': POINT:POINT:LENGTH, e.g. door:lamp:1.25m: marks have no places, and this gives the rig its "
        "size; repeatable");
  visit("camera-distance", o.camera_distance,
        "option 'from-scene': CAMERA:CAMERA:LENGTH gives the scale, e.g. left:right:1.234m");
  visit("rigid", o.rigid, "option 'scene-points': place the rig of option 'start' as a rigid body");
  VisitFields(visit, o.points);
  VisitFields(visit, o.scene);
}

struct CalibrateOptions {
  SessionArguments session;
  CornerArguments corners;
  std::string save_corners;  ///< file for the corners that were found; empty: none
  std::string out;           ///< folder of calibration.json; empty: that of the session
  calib::CalibrateOptions solve;
  SceneOptions scene;
  std::string start;   ///< a calibration to start from; may be empty
  std::string lenses;  ///< a library of lenses, instead; may be empty
  BudgetOptions budget;
  std::set<std::string> given;  ///< names of options that a budget must leave alone though they have their defaults
};

/// Those that concern a board.
template <class Visitor>
void VisitBoardFields(Visitor&& visit, CalibrateOptions& o) {
  VisitFields(visit, o.corners);
  VisitSession(visit, o.session, "board and footage", "a board");
  StartGroup(visit, "Output");
  VisitStyled(visit, OptionStyle::kFile, "save-corners", o.save_corners, "also write the corners that were found, CSV");
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out, "folder for calibration.json; SESSION/calib unless given");
  VisitFields(visit, o.solve);
}

template <class Visitor>
void VisitFields(Visitor&& visit, CalibrateOptions& o) {
  VisitBoardFields(visit, o);
  VisitFields(visit, o.scene);
  StartGroup(visit, "Known calibrations");
  visit("start", o.start, "a calibration to start from; its cameras keep their lens models");
  visit("lenses", o.lenses,
        "library of mvstudio calib lenses: lenses of the session's cameras, by their serial; they are held");
  VisitBudget(visit, o.budget,
              "uncertainty that is enough, e.g. 0.2px (of projections at the image's sides) or 1mm (of points where boards "
              "were): the cheapest setting that a trial predicts to reach it");
}

}  // namespace mvstudio::stages
