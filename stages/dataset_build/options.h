#pragma once

#include <string>

#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "core/disk/kept.h"
#include "core/fields.h"
#include "dataset/build/build.h"
#include "stages/input/take_input.h"

/// Footage, calibration and 3D joints -> a dataset in Panoptic layout: what a caller gives.
namespace mvstudio::stages {

struct DatasetBuildOptions {
  std::string calib;  ///< empty: that of the session
  TakeArguments take;
  std::string pose3d;       ///< see dataset::BuildInputs; empty: that of the session's take
  std::string frames;       ///< "80-99" or "1,4,7-9": time steps of the joints; empty: all
  int first_frame = 0;      ///< see dataset::BuildInputs
  int first_mask = 0;       ///< the same
  std::string marker_unit;  ///< of a file of markers; empty: as it states
  std::string skeleton;     ///< of the 3D joints; empty: as they state
  std::string out;          ///< new folder; empty: that of the session's take
  std::string masks;        ///< folder with a folder of masks for each camera; empty: those of the session's take, or new ones
  bool make_masks = false;  ///< without `masks`: make new ones also where the session's take has some
  bool no_masks = false;
  CachePlace cache;  ///< of what a build that was cut has made; auto: beside `out`
  std::string part;  ///< see ParsePart; empty: all of it
  dataset::BuildOptions build;
  bool keep_sequence = false;  ///< build.sequence holds also where the session's take has a name
  bool keep_rate = false;      ///< build.frame_rate_hz holds also where the session or the joints state one
};

template <class Visitor>
void VisitFields(Visitor&& visit, DatasetBuildOptions& o) {
  StartGroup(visit, "Calibration and 3D joints");
  visit("calib", o.calib, "calibration.json, ours or Panoptic's; default: the session's");
  VisitFields(visit, o.take);
  StartGroup(visit, "Calibration and 3D joints");
  visit(
      "pose3d", o.pose3d,
      "folder with points.csv, as triangulate writes it, a dataset or folder of body3DScene_*.json, or a file of markers; the "
      "session's pose3d/TAKE unless given");
  visit("frames", o.frames, "80-99 or 1,4,7-9: time steps of the joints; all unless given");
  visit(
      "first-frame", o.first_frame,
      "number that the joints give the footage's first frame; 1 is found where they are numbered 1 to N and the footage has N");
  visit("marker-unit", o.marker_unit,
        "m, cm, mm, in or the length of one unit, e.g. 25mm: instead of what the file of markers states");
  visit("skeleton", o.skeleton,
        "of the 3D joints, where option 'pose3d' does not state it: a name that triangulate knows, or a file FILE.toml "
        "(docs/formats.md)");
  StartGroup(visit, "Dataset");
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out, "new folder; the session's dataset/TAKE unless given");
  visit("masks", o.masks,
        "folder with a folder of masks for each camera, named by frame; alone: make masks. The session's masks/TAKE, where it "
        "is there, unless given");
  visit("first-mask", o.first_mask, "number of the first frame's mask, where frames count from 0; 1 is found in the same way");
  VisitStyled(visit, OptionStyle::kSwitch, "no-masks", o.no_masks, "no masks");
  visit("cache", o.cache,
        "where images and masks are kept until the dataset is there, so that a build that was cut goes on with the next 300 "
        "frames: a folder, off, or auto: hidden beside option 'out', where they take no room of their own");
  visit("part", o.part,
        "keep a part for a later run with the same option 'cache', a folder, and write a list alone: samples=CAMERA (what is "
        "learned of its footage), frames=CAMERA or frames=CAMERA:3-5 (blocks of 300 frames)");
  VisitFields(visit, o.build);
}

}  // namespace mvstudio::stages
