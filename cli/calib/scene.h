#pragma once

#include <string>
#include <vector>

#include "calib/board/observations.h"
#include "calib/corners/corner_options.h"
#include "calib/points/from_scene.h"
#include "calib/points/scene_points.h"
#include "cli/program/command.h"
#include "core/choice/option_group.h"

namespace mvstudio::cli {

/// `mvstudio calibrate` without footage of a board: marked points, or the scene itself.
struct SceneArguments {
  std::string from_scene;                 ///< folder or pattern of images, one a camera, named by the camera
  std::vector<std::string> scene_points;  ///< one or two CSV files
  std::string camera_distance;            ///< "A:B:1.234m"
  std::vector<std::string> lengths;       ///< of marks without places, see calib/points/stated_length.h
  bool rigid = false;                     ///< scene points: --start gives a rig whose cameras keep their relative poses
  calib::PointResectionOptions points;
  calib::FromSceneOptions scene;
};

template <class Visitor>
void VisitFields(Visitor&& visit, SceneArguments& o) {
  mvstudio::StartGroup(visit, "Without a board");
  visit("from-scene", o.from_scene,
        "images of the empty scene, one for each camera and named by it: a folder or a pattern in quotes");
  visit("scene-points", o.scene_points,
        "CSV camera,point,x_px,y_px and CSV point,x,y,z (metres), in one file or two: marks with known places; with --length "
        "the clicks suffice");
  visit("length", o.lengths,
        "--scene-points: POINT:POINT:LENGTH, e.g. door:lamp:1.25m: marks have no places, and this gives the rig its size; "
        "repeatable");
  visit("camera-distance", o.camera_distance, "--from-scene: CAMERA:CAMERA:LENGTH gives the scale, e.g. left:right:1.234m");
  visit("rigid", o.rigid, "--scene-points: place the rig of --start as a rigid body");
  VisitFields(visit, o.points);
  VisitFields(visit, o.scene);
}

/// True when the arguments ask for a calibration without footage of a board.
inline bool UsesScene(const SceneArguments& arguments) {
  return !arguments.from_scene.empty() || !arguments.scene_points.empty();
}

/// Marked points as a board of points that every camera saw in frame 0. Sizes of images are 0 where `sizes` do not state them.
calib::CalibrateInput PointsAsBoard(const calib::ScenePoints& points, const std::vector<calib::CameraSize>& sizes);

/// --from-scene when it is given, else --scene-points alone. `lenses` are those that are known, `boards` what --board named:
/// with
/// --from-scene the first one is looked for in the images and gives place and scale. Writes calibration.json to the folder
/// `out`. `result` holds what was said so far.
CommandResult RunScene(const SceneArguments& arguments, const geometry::Rig& lenses, const std::vector<calib::Board>& boards,
                       const std::string& out, CommandContext& context, CommandResult result);

}  // namespace mvstudio::cli
