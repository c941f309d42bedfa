#pragma once

#include <set>
#include <string>
#include <vector>

#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "core/disk/kept.h"
#include "dataset/detect/segment/segment.h"
#include "dataset/masks/mask_take.h"
#include "dataset/masks/size_rule.h"
#include "dataset/masks/visual_hull.h"
#include "stages/budget/ask.h"
#include "stages/input/calib_read.h"
#include "stages/input/pose_changes.h"
#include "stages/input/pose_input.h"
#include "stages/input/take_input.h"

/// Foreground masks of people in a take's footage: what a caller gives.
namespace mvstudio::stages {

struct MaskRunOptions {
  int hull_frames = 24;
  int trial_frames = 6;
  int sheet_tiles = 24;
  bool soft = false;
  bool hull = false;
  bool keep_undamaged = false;
  bool overwrite = false;
  dataset::SizeRuleChoice size_rule = dataset::SizeRuleChoice::kAuto;
};

template <class Visitor>
void VisitFields(Visitor&& visit, MaskRunOptions& o) {
  visit("soft", o.soft, "write the covered share of each pixel, too: OUT/soft/CAMERA/%08d.png, 0..255");
  visit(
      "hull", o.hull,
      "make the masks twice, the second time without pixels that the masks of two other cameras exclude; needs option 'calib'");
  visit("hull-frames", o.hull_frames, "frames on which masks are compared with the visual hull; 0: none");
  visit("trial-frames", o.trial_frames, "frames on which option 'backend' auto tries every backend");
  visit("sheet-tiles", o.sheet_tiles, "images on each camera's contact sheet; 0: no sheet");
  visit("size-rule", o.size_rule,
        "footage of another size than calibrated: auto, fill, stretch, crop-right, crop-centre or crop-left");
  visit("keep-undamaged", o.keep_undamaged, "use what decodes of damaged footage and list what is missing");
  visit("overwrite", o.overwrite, "replace the output folder");
}

struct MaskStageOptions {
  TakeArguments take;
  std::string calib;                ///< empty: that of the session, if any
  CalibReadOptions read;            ///< how the calibration is meant
  std::string pose3d;               ///< empty: that of the session's take, unless 2D joints are given
  std::string marker_unit;          ///< of a file of markers; empty: as it states
  std::vector<NamedPath> pose2d;    ///< folders
  std::string skeleton = "body25";  ///< of the 2D joints
  PoseChanges changes;              ///< what the 2D joints mean; its frames are the time steps that get masks
  std::string out;                  ///< new folder; empty: that of the session's take
  MaskRunOptions run;
  CachePlace cache;
  std::string part;  ///< see ParsePart; empty: all of it
  std::string backend = "auto";
  std::vector<NamedPath> truth;  ///< folders or patterns of exact masks
  detect::OnnxSegmenterOptions onnx;
  dataset::MaskOptions mask;
  dataset::HullOptions hull;
  BudgetOptions budget;
  std::set<std::string> given;  ///< names of options that a budget must leave alone though they have their defaults
};

template <class Visitor>
void VisitFields(Visitor&& visit, MaskStageOptions& o) {
  VisitFields(visit, o.take);
  StartGroup(visit, "Calibration and joints");
  visit("calib", o.calib,
        "calibration file: ours, Panoptic's, or any that calib convert reads; masks are compared across cameras");
  VisitStyled(visit, OptionStyle::kSwitch, "invert", o.read.invert, kInvertHelp);
  VisitStyled(visit, OptionStyle::kSwitch, "mirror", o.read.mirror, kMirrorHelp);
  visit("pose3d", o.pose3d,
        "3D joints that guide the masks: a folder with points.csv or body3DScene_*.json, a dataset, or a file of markers; the "
        "session's pose3d/TAKE where it is there");
  visit("marker-unit", o.marker_unit,
        "m, cm, mm, in or the length of one unit, e.g. 25mm: instead of what the file of markers states");
  visit("pose2d", o.pose2d, "CAMERA=FOLDER of OpenPose JSON files, instead of option 'pose3d'");
  visit("skeleton", o.skeleton, "of the 2D joints, a name or a file FILE.toml");
  VisitFields(visit, o.changes);
  StartGroup(visit, "Output");
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out, "new folder; the session's masks/TAKE unless given");
  VisitFields(visit, o.run);
  visit("cache", o.cache,
        "where masks are kept until all are there, so that a run that was cut goes on with the next 300 frames: a folder, off, "
        "or auto: $MVSTUDIO_CACHE, $XDG_CACHE_HOME/mvstudio or ~/.cache/mvstudio");
  visit("part", o.part,
        "keep a part for a later run with the same option 'cache', and write a list alone: samples=CAMERA, choice (of the "
        "backend), frames=CAMERA or frames=CAMERA:3-5 (blocks of 300 frames)");
  StartGroup(visit, "Backend");
  visit("backend", o.backend,
        "background (what the images show without people), selfie (a small net), onnx:FILE, or auto: the one whose masks agree "
        "best with the visual hull and the joints");
  visit("truth", o.truth, "CAMERA=FOLDER of exact masks to compare with");
  VisitFields(visit, o.onnx);
  StartGroup(visit, "Background");
  VisitFields(visit, o.mask);
  StartGroup(visit, "Visual hull");
  VisitFields(visit, o.hull);
  VisitBudget(visit, o.budget,
              "disagreement with the visual hull that is enough, e.g. 12%: the cheapest setting that a trial predicts to reach "
              "it");
}

}  // namespace mvstudio::stages
