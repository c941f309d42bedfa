#pragma once

#include <functional>
#include <set>
#include <string>
#include <vector>

#include "core/choice/auto_on_off.h"
#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "stages/budget/ask.h"
#include "stages/input/pose_input.h"
#include "stages/input/project_input.h"
#include "stages/input/session_input.h"
#include "stages/people/marker_export.h"
#include "triangulate/skeleton/refine.h"
#include "triangulate/take/take.h"

/// 2D joints of several cameras -> 3D joints: what a caller gives.
namespace mvstudio::stages {

struct TriangulateOptions {
  PoseArguments pose;
  SessionArguments session;
  std::vector<NamedPath> video, images;  ///< the footage, for the report's images alone
  std::string project;                   ///< a folder, instead of the session and the poses
  std::string out;                       ///< folder of the points; empty: that of the session's take
  triangulate::TakeOptions points;
  std::string sync;  ///< sync.json; may be empty
  AutoOnOff calibration_offsets = AutoOnOff::kAuto;
  bool refine = false;
  triangulate::SkeletonRefineOptions refinement;
  int chunk_frames = 0;
  BudgetOptions budget;
  MarkerOptions markers;
  std::string trc, truth, marker_unit;  ///< references, and the unit of their marker files; may be empty
  bool align_truth = false;

  std::set<std::string> given;  ///< names of options on which a project has no say: those that somebody chose
  /// How texts that are kept in files name options; unless given as `option 'min-views'`.
  std::function<std::string(const std::string&)> file_text = {};
};

template <class Visitor>
void VisitFields(Visitor&& visit, TriangulateOptions& o) {
  VisitFields(visit, o.pose);
  VisitSession(visit, o.session, "calibration, 2D poses and the timing of the cameras", "people");
  StartGroup(visit, "Images of the report");
  VisitStyled(visit, OptionStyle::kRepeated, "video", o.video,
              "CAMERA=FILE: the footage, for the report's images alone; repeat for each camera");
  visit("images", o.images, "CAMERA=FOLDER or CAMERA=PATTERN: the same of image files");
  StartGroup(visit, "Session");
  visit("project", o.project, kProjectHelp);
  StartGroup(visit, "Output");
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out,
              "folder for points.csv, covariance.csv, pose3d.json; SESSION/pose3d/TAKE unless given");
  StartGroup(visit, "Points");
  VisitFields(visit, o.points);
  StartGroup(visit, "Timing");
  visit("sync", o.sync, "sync.json of `mvstudio sync`: time offsets of the cameras");
  visit("calibration-offsets", o.calibration_offsets,
        "time offsets that the calibration states, where the take has no timing of its own: auto (when left-out cameras "
        "confirm them), on or off");
  StartGroup(visit, "Joints together");
  VisitStyled(visit, OptionStyle::kSwitch, "refine", o.refine,
              "refine the joints of each person together: smoothness and bone lengths, each only where it predicts left-out "
              "cameras better; not with option 'chunk-frames'");
  VisitFields(visit, o.refinement);
  StartGroup(visit, "Points");
  visit("chunk-frames", o.chunk_frames,
        "for takes longer than memory: frames of option 'pose2d' processed at a time (a table is held whole); noise and method "
        "come from frames spread over the take; 0: all at once");
  VisitBudget(visit, o.budget,
              "error that is enough, e.g. 0.5px (held-out) or 2mm (stated sigma, as far as held-out cameras confirm it): the "
              "cheapest setting that a trial predicts to reach it");
  StartGroup(visit, "Marker files");
  VisitFields(visit, o.markers);
  StartGroup(visit, "Comparison");
  visit("trc", o.trc,
        "compare with the markers of this .trc or .c3d file (its frame 1 is our frame 0; y up unless a .c3d says z)");
  visit("truth", o.truth,
        "compare with a folder of body3DScene files, points of mvstudio, or 3D joints as `markers convert` takes them");
  visit("marker-unit", o.marker_unit,
        "m, cm, mm, in or the length of one unit, e.g. 25mm: instead of what the file of markers states");
  VisitStyled(visit, OptionStyle::kSwitch, "align-truth", o.align_truth,
              "take out the best rigid motion before comparing with option 'truth'");
}

}  // namespace mvstudio::stages
