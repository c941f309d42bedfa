// Private: a step of BuildPack.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dataset/colour/colour_match.h"
#include "dataset/pack/build.h"
#include "dataset/pack/codec.h"
#include "dataset/pack/pack.h"
#include "dataset/panoptic/missing.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/views/crop.h"

namespace mvstudio::dataset::internal {

/// A person to be cropped from an image; with whole images, the owner of its joints (-1: nobody).
struct PackTarget {
  int person = -1;
  PersonExtent extent;
};

/// One image file and its samples.
struct PackImage {
  int camera_idx = 0;
  int frame = 0;
  PartOfSplit part = PartOfSplit::kNone;
  std::vector<PackTarget> targets;
};

/// The options with all choices made: the same for every process that works on the pack.
struct PackPlan {
  PackOptions options;
  PackView view = PackView::kCrop;
  bool masks = false;
  PanopticDataset dataset;
  std::vector<geometry::RigCamera> views;  ///< whole images: the camera of each, by camera_idx
  std::map<int, double> half_extent_m;     ///< crops: by person
  ColourMatch colour;
  std::map<int, std::string> scene_paths;      ///< body3DScene files
  std::vector<std::vector<PackImage>> shards;  ///< in order of frame, camera
  int frames_without_person = 0;               ///< of the chosen frames, those without anybody (or the chosen person)
  std::string frames_beyond;                   ///< see KnownFrames
  MissingImages missing;                       ///< of the shards' images and, with masks, masks
  std::string json, sha256, rig_json;
};

/// Throws UsageError for names, frames and sizes that do not fit the dataset, FormatError when a camera has no image.
PackPlan MakePackPlan(const std::string& dataset_root, const PackOptions& options, const RunContext& run);

std::string ToString(PackView view);

}  // namespace mvstudio::dataset::internal
