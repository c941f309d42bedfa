#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/fields.h"
#include "core/progress.h"
#include "core/status.h"
#include "dataset/colour/colour_match.h"
#include "dataset/footage/mask_io.h"
#include "dataset/pack/codec.h"
#include "dataset/panoptic/missing.h"
#include "dataset/views/undistort.h"

/// Dataset folder -> pack: HDF5 shards that several processes can make together; each file appears complete or not at all.
namespace mvstudio::dataset {

struct PackOptions {
  PackCodec codec;
  int crop_px = 256;
  bool full = false;
  bool undistort = false;
  bool match_colours = false;
  bool masks = true;
  int person = -1;
  double fill = 0.97;
  double half_extent_m = 0;
  int shard_samples = 512;
  std::vector<std::string> cameras;  ///< Panoptic or studio names; empty: all
  std::vector<int> frames;           ///< empty: all with a body3DScene file
  std::string split;                 ///< file of `mvstudio.split/1`: only its images, marked by part
  UndistortOptions undistort_view;   ///< with `undistort`
  ColourMatchOptions colour;         ///< with `match_colours`
};

template <class Visitor>
void VisitFields(Visitor&& visit, PackOptions& o) {
  visit("codec", o.codec, "png, jpeg:Q (1 to 100) or raw");
  visit("crop", o.crop_px, "edge of the square image around each person, px");
  visit("full", o.full, "whole images instead of crops");
  visit("undistort", o.undistort, "with option 'full': as pinhole cameras would have taken them (crops always are)");
  visit("match-colours", o.match_colours, "match the cameras' colours by the surfaces that they share");
  visit("masks", o.masks, "store the masks of the dataset");
  visit("person", o.person, "person id; -1: everyone (with option 'full': joints of the one with most frames)");
  visit("fill", o.fill, "share of the crop that a person's largest poses (98 % quantile) fill");
  visit("half-extent", o.half_extent_m, "metres from a crop's centre that `fill` stands for; 0: by the person's poses");
  visit("shard-samples", o.shard_samples, "images in one file, at most; whole frames stay together");
}

/// The shards that one call makes: those with number % count == index.
struct ShardShare {
  int index = 0;
  int count = 1;
};

/// Seconds, summed over threads except write_s, verify_s and wall_s.
struct PackTimes {
  double decode_s = 0;    ///< images and masks of the dataset, files to pixels
  double hash_s = 0;      ///< digests of those files
  double resample_s = 0;  ///< crops, undistortion, colours
  double encode_s = 0;
  double write_s = 0;   ///< HDF5 file made and flushed to disk
  double verify_s = 0;  ///< read again and compared
  double wall_s = 0;
};

/// Errors of undistortion for one camera's images.
struct PackUndistortion {
  std::string camera;
  double max_joint_px = 0;  ///< footage px: the pinhole's projection of a joint against the lens's
  double max_map_px = 0;    ///< footage px: the same through the map that images are resampled with
  double lost_share = 0;    ///< fraction of the footage's pixels that the pinhole does not show
  double empty_share = 0;   ///< fraction of the pinhole's pixels without a source
};

struct PackBuildReport {
  int num_shards = 0;                          ///< of the pack
  std::vector<int> built, kept, busy;          ///< shards made now, found finished, being made by another process
  std::vector<std::string> notes;              ///< why a shard was made again
  MaskMeaning masks = {};                      ///< how the masks were read; nothing after a merge
  std::vector<std::string> skipped;            ///< images left out: "camera 00_03, frame 17: no image"
  MissingImages missing;                       ///< of the whole pack's images and masks; nothing after a merge
  std::string frames_beyond;                   ///< what was asked for and is not there, see KnownFrames
  int frames_without_person = 0;               ///< that were asked for; nothing after a merge
  int64_t samples = 0;                         ///< in built and kept shards
  uint64_t bytes = 0;                          ///< of their files
  bool complete = false;                       ///< INDEX.json was written, or is up to date
  std::string busy_owner;                      ///< owner of the first busy one
  Status colour_status = Status::kOk;          ///< other than kOk: colours stayed unchanged
  std::string colour_reason;                   ///< which colour model was chosen and why
  std::vector<PackUndistortion> undistortion;  ///< of each camera, when images are undistorted
  int threads = 1;
  PackTimes times;
};

/// Makes the shards of `share` in the folder `out` and, when `share` is everything and all shards exist, INDEX.json.
/// Finished shards (file and inputs have the digests of the done-marker) are kept, damaged ones made again. The files do
/// not depend on threads, on the share or on earlier interruptions. Images that are not there are left out, samples
/// without a mask have none. Throws UsageError when `out` holds a pack of other options, FormatError when a camera has no
/// image.
PackBuildReport BuildPack(const std::string& dataset_root, const std::string& out, const PackOptions& options,
                          const ShardShare& share = {}, const RunContext& run = {});

/// Checks that every shard exists, is complete, and belongs to one plan, and writes INDEX.json. Throws FormatError naming
/// every missing or damaged shard.
PackBuildReport MergePack(const std::string& out, const RunContext& run = {});

/// Copies a finished pack into one file. Throws ResourceError above 8 GiB.
void WriteSinglePack(const std::string& pack, const std::string& file);

}  // namespace mvstudio::dataset
