#pragma once

#include <string>

#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "core/fields.h"
#include "dataset/pack/build.h"

/// A dataset -> HDF5 shards: what a caller gives.
namespace mvstudio::stages {

struct DatasetPackOptions {
  std::string dataset;  ///< folder in Panoptic layout; may be empty with `merge`
  std::string out;      ///< folder of the pack
  std::string shard;    ///< "K/N": only every N-th shard, from K; empty: all
  bool merge = false;   ///< only check that all shards are there, and write INDEX.json
  bool allow_lost_joints = false;
  std::string single;  ///< file for a copy of the finished pack; empty: none
  std::string frames;  ///< "0-99,150", in place of pack.frames; empty: those
  dataset::PackOptions pack;
};

/// Without the dataset.
template <class Visitor>
void VisitFields(Visitor&& visit, DatasetPackOptions& o) {
  StartGroup(visit, "Pack");
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out, "folder of the pack; an unfinished one is continued");
  visit("shard", o.shard, "K/N: make only every N-th shard, from K; several terminals or a job array share a pack");
  VisitStyled(visit, OptionStyle::kSwitch, "merge", o.merge, "check that all shards are there and write INDEX.json");
  VisitStyled(visit, OptionStyle::kSwitch, "allow-lost-joints", o.allow_lost_joints,
              "pack a dataset of another skeleton although most of its joints are none of Panoptic's 19");
  VisitStyled(visit, OptionStyle::kFile, "single", o.single, "copy the finished pack into this one HDF5 file as well");
  StartGroup(visit, "Content");
  VisitStyled(visit, OptionStyle::kList, "cameras", o.pack.cameras,
              "Panoptic or studio names, separated by commas; default: all");
  visit("frames", o.frames, "frames to pack, e.g. 0-99,150; default: all with 3D joints");
  visit("split", o.pack.split, "split file: pack its images only, each marked train, validation or test");
  VisitFields(visit, o.pack);
  StartGroup(visit, "Undistortion and colours");
  VisitFields(visit, o.pack.undistort_view);
  VisitFields(visit, o.pack.colour);
}

}  // namespace mvstudio::stages
