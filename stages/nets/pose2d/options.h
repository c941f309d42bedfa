#pragma once

#include <set>
#include <string>

#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "core/disk/kept.h"
#include "dataset/detect/joints/joint_net.h"
#include "dataset/detect/joints/pose_tracker.h"
#include "stages/budget/ask.h"
#include "stages/input/take_input.h"

/// 2D keypoints of people in a take's footage: what a caller gives.
namespace mvstudio::stages {

struct Pose2dOptions {
  TakeArguments take;  ///< its frames keep their own numbers; triangulate turns them into time steps
  std::string out;     ///< folder; empty: that of the session's take
  std::string backend = "auto";
  std::string calib;  ///< empty: that of the session, if any
  std::string models;
  std::string skeleton = "body25";  ///< of files that are there
  int trial_frames = 16;
  int overlays = 2;
  std::string frames;  ///< "80-99" or "1,4,7-9"; empty: all
  int every = 1;
  CachePlace cache;
  std::string part;  ///< see ParsePart; empty: all of it
  bool overwrite = false;
  detect::PoseOptions pose;
  detect::OnnxOptions onnx;
  BudgetOptions budget;
  std::set<std::string> given;  ///< names of options that a budget must leave alone though they have their defaults

  Pose2dOptions() { take.with_timeline = false; }
};

template <class Visitor>
void VisitFields(Visitor&& visit, Pose2dOptions& o) {
  VisitFields(visit, o.take);
  StartGroup(visit, "Net");
  visit("backend", o.backend,
        "posenet, movenet or blazepose (with feet; mvstudio models fetch), onnx:FILE (heat maps), openpose:FOLDER "
        "(FOLDER/CAMERA holds JSON files that are checked and renumbered), auto: the installed net whose keypoints agree best "
        "across cameras (needs option 'calib')");
  visit("models", o.models, "folder of the weights; default: as models fetch");
  visit("trial-frames", o.trial_frames, "auto: frames on which the nets are compared");
  VisitFields(visit, o.onnx);
  StartGroup(visit, "Frames and cameras");
  visit("frames", o.frames, "80-99 or 1,4,7-9: frames of the footage; all unless given");
  visit("every", o.every, "use every n-th frame of the footage; the others have no keypoints");
  visit("calib", o.calib, "calibration: reports how well the cameras agree");
  StartGroup(visit, "Keypoints");
  visit("skeleton", o.skeleton, "openpose: the skeleton of the existing files, a name or a file FILE.toml");
  VisitFields(visit, o.pose);
  StartGroup(visit, "Output");
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out,
              "folder: CAMERA/%012d_keypoints.json and overlay/ (default with option 'session': its pose2d/TAKE)");
  visit("overlays", o.overlays, "images of each camera to draw the keypoints on");
  visit("cache", o.cache,
        "where keypoints are kept, so that a run that was cut goes on with the next 300 frames: a folder, off, or auto: "
        "$MVSTUDIO_CACHE, $XDG_CACHE_HOME/mvstudio or ~/.cache/mvstudio");
  visit(
      "part", o.part,
      "keep a part for a later run with the same option 'cache', and write a list alone: choice (of the net), frames=CAMERA or "
      "frames=CAMERA:3-5 (blocks of 300 frames)");
  VisitStyled(visit, OptionStyle::kSwitch, "overwrite", o.overwrite, "replace the output folder");
  VisitBudget(
      visit, o.budget,
      "error that is enough, e.g. 3px, of a camera's keypoints from where the others put them: the cheapest setting that "
      "a trial predicts to reach it");
}

}  // namespace mvstudio::stages
