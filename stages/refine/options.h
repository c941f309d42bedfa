#pragma once

#include <string>
#include <vector>

#include "calib/keypoints/refine.h"
#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "stages/calib/stated_lengths.h"
#include "stages/input/pose_input.h"

/// A rig adjusted to people, markers or animals instead of boards: what a caller gives.
namespace mvstudio::stages {

struct RefineOptions {
  bool from_keypoints = false;            ///< asked for by name; a table of points asks for it, too
  PoseArguments pose;                     ///< the calibration to refine, and what its cameras see
  std::string sync;                       ///< sync.json; may be empty
  std::string train_frames, test_frames;  ///< "START:STEP"; "": see calib/keypoints/refine.h
  std::vector<std::string> lengths;       ///< see calib/points/stated_length.h
  double person_height_m = 0;             ///< 0: not said; for lenses without poses
  calib::KeypointRefineOptions adjust;
  std::string out;  ///< folder of calibration.json

  bool IsGiven() const { return from_keypoints || !pose.points2d.empty(); }
};

/// Without the calibration and the folder, which a refinement to boards has as well.
template <class Visitor>
void VisitFields(Visitor&& visit, RefineOptions& o) {
  constexpr char kSubject[] = "People, markers or animals";
  StartGroup(visit, kSubject);
  VisitStyled(visit, OptionStyle::kSwitch, "from-keypoints", o.from_keypoints,
              "adjust to what several cameras see at once, option 'pose2d' or option 'points2d', instead of boards");
  visit("pose2d", o.pose.pose2d,
        "option 'from-keypoints': NAME=FOLDER of OpenPose JSON files, or NAME=FILE of DeepLabCut, SLEAP, MMPose, …; repeat for "
        "each camera");
  visit("points2d", o.pose.points2d,
        "instead: table camera,frame,person,joint,x_px,y_px,score (CSV) of all cameras, for markers, wands and animals; "
        "joints may be names or numbers, frames need no connection in time");
  visit("skeleton", o.pose.skeleton,
        "option 'from-keypoints': a name that triangulate knows, or a file FILE.toml (docs/formats.md); body25 unless given, "
        "of option 'points2d', DeepLabCut and SLEAP the points in the file");
  visit("unit,calib-unit", o.pose.calib_unit,
        "option 'from-keypoints': m, cm, mm or in: of a calibration that names no unit; m unless given");
  visit("sync", o.sync, "option 'from-keypoints': sync.json of `mvstudio sync`: time offsets and rates of the cameras");
  VisitFields(visit, o.pose.changes);
  StartGroup(visit, kSubject);
  visit("train-frames", o.train_frames,
        "option 'from-keypoints': START:STEP; frames to adjust to, the others (or option 'test-frames') only measure the "
        "result; without both, each half of the take measures what was adjusted to the other, and the rig is adjusted to all");
  visit("test-frames", o.test_frames, "option 'from-keypoints': START:STEP; frames that measure the result");
  visit("length", o.lengths, std::string("option 'from-keypoints': ") + kLengthHelp);
  VisitStyled(visit, OptionStyle::kUnset, "person-height", o.person_height_m,
              "metres; option 'from-keypoints' with lenses that have no poses: the cameras are placed by the person, whose "
              "height gives the rig's size; 1.7 is assumed; own skeletons state lengths instead");
  VisitFields(visit, o.adjust);
}

}  // namespace mvstudio::stages
