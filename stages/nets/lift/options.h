#pragma once

#include <string>
#include <vector>

#include "avatar/run/lift/lift_take.h"
#include "core/choice/option_style.h"
#include "stages/input/calib_read.h"
#include "stages/input/pose_changes.h"
#include "stages/input/pose_input.h"

/// 3D joints from one camera: what a caller gives.
namespace mvstudio::stages {

/// For a lifter that learns from the 3D poses of datasets.
struct LiftTrainOptions {
  std::vector<std::string> datasets;  ///< folders
  std::string out;                    ///< file
  double holdout_share = 0.25, holdout_noise_px = 1;
  int baseline_poses = 8192;
  avatar::LiftOptions net;
  avatar::LiftSampleOptions samples;
};

template <class Visitor>
void VisitFields(Visitor&& visit, LiftTrainOptions& o) {
  visit("out", o.out, "file for the lifter, .safetensors");
  visit("holdout-share", o.holdout_share,
        "share of each dataset's frames, its last ones, that is scored in all its cameras and not trained on");
  visit("holdout-noise-px", o.holdout_noise_px, "px; noise of the held-out 2D joints");
  visit("baseline-poses", o.baseline_poses, "known poses in random views that the nearest neighbour is taken from");
  VisitFields(visit, o.net);
  VisitFields(visit, o.samples);
}

/// For a take that is lifted.
struct LiftApplyOptions {
  CalibReadOptions read;
  PoseChanges changes;
  std::string pose2d, lifter, calib, camera, out, skeleton = "body25", truth, marker_unit;
  double rate_hz = 0;  ///< stated beside the joints; 0: by the changes
  double height_m = 0, min_score = 0.2, smooth = 0;
  int stride = 1;
  bool level = true;
};

template <class Visitor>
void VisitFields(Visitor&& visit, LiftApplyOptions& o) {
  visit("lifter", o.lifter, "file of `avatar lift train`");
  visit("calib", o.calib, "calibration; its lens and place of the camera are used");
  visit("camera", o.camera, "name of the camera in option 'calib'");
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out, "folder for points.csv, as triangulate writes it");
  visit("skeleton", o.skeleton, "of the 2D joints");
  visit("height-m", o.height_m, "m; height of the person, which scales distance and size; 0: as those learned from");
  visit("min-score", o.min_score, "0..1; joints with a lower score count as not seen");
  VisitStyled(visit, OptionStyle::kUnset, "frame-rate", o.rate_hz,
              "frames a second, e.g. 60, stated beside the joints for those who read them");
  VisitStyled(visit, OptionStyle::kSwitch, "invert", o.read.invert, kInvertHelp);
  VisitStyled(visit, OptionStyle::kSwitch, "mirror", o.read.mirror, kMirrorHelp);
  visit("stride", o.stride, "frames between the five that are lifted together; 2 for twice the learned frame rate");
  visit("smooth", o.smooth, "frames; standard deviation of a Gaussian over time; 0: every frame by itself");
  visit("level", o.level, "the calibration's z axis points up; off: the image's upper edge is up");
  visit("truth", o.truth,
        "3D joints to compare with: a dataset, a folder with points.csv or body3DScene_*.json, or a file of markers");
  visit("marker-unit", o.marker_unit,
        "m, cm, mm, in or the length of one unit, e.g. 25mm: instead of what the file of markers states");
  VisitFields(visit, o.changes);
}

}  // namespace mvstudio::stages
