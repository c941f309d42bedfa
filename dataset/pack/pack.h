#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/image.h"
#include "core/progress.h"
#include "dataset/pose/pose3d.h"
#include "dataset/verify/verify.h"
#include "dataset/views/split.h"
#include "geometry/rig/rig.h"

/// Reads packs: images of people with their cameras, masks and joints in HDF5 files, for training and archive.
/// docs/formats.md describes the format; dataset/pack/build.h makes packs.
namespace mvstudio::dataset {

inline constexpr char kPackSchema[] = "mvstudio.pack/1";

/// Content of the images of a pack.
enum class PackView {
  kCrop,         ///< a person, seen by a pinhole camera rotated towards them
  kFull,         ///< the whole image, through the camera's own lens
  kUndistorted,  ///< the whole image, as a pinhole would have taken it
};

/// One image of a pack.
struct PackSample {
  int camera_idx = 0;        ///< of Pack::rig
  int frame = 0;             ///< as in the dataset
  double univ_time_ms = -1;  ///< Panoptic's clock; -1 when unknown
  int person = -1;           ///< owner of these joints; -1: nobody
  geometry::RigCamera view;  ///< the camera of the stored image; joints project through it
  Coco19Pose pose;           ///< in world, metres; as in the dataset
  Eigen::Matrix<double, 2, 19> joints_px =
      Eigen::Matrix<double, 2, 19>::Zero();  ///< in the stored image; 0 where not in view
  std::array<bool, 19> in_view{};            ///< the joint is valid and its projection lies inside the image
  PartOfSplit part = PartOfSplit::kNone;
  bool has_mask = false;
};

struct PackInfo {
  std::string path, sequence;
  PackView view = PackView::kCrop;
  std::string image_codec;          ///< "png", "jpeg:90", "raw"
  std::string mask_codec;           ///< "png", "none"
  int width_px = 0, height_px = 0;  ///< of the images; 0 when they differ
  int shards = 0, cameras = 0, frames = 0, people = 0;
  int64_t samples = 0;
  uint64_t bytes = 0;     ///< of the HDF5 files
  std::string plan_json;  ///< options, cameras and digests of the inputs
  bool complete = false;  ///< INDEX.json is there, or it is a single file
};

struct PackOpenOptions {
  /// First read structure and tables in a separate process, which may crash or be stopped without harm: a hostile file can
  /// crash HDF5. Costs a few milliseconds per file; turn it off for packs of your own.
  bool check_in_child = true;
  double deadline_s = 30;                  ///< of that process, per file
  uint64_t max_memory_bytes = 1ull << 30;  ///< memory limit of that process beyond what this one uses
};

/// An open pack. All members are const and may be called from several threads; each image costs one read of its own
/// bytes. The table of samples is in memory.
class Pack {
 public:
  const PackInfo& info() const;
  /// The cameras of the dataset with their full lens models.
  const geometry::Rig& rig() const;
  /// In order of frame, camera, person.
  const std::vector<PackSample>& samples() const;

  /// RGB, of the size of samples()[i].view. Throws FormatError when its bytes do not match their checksum.
  Image ReadImage(size_t i) const;
  /// Grey, 0 or 255; empty when the sample has none.
  Image ReadMask(size_t i) const;
  /// The encoded image as stored, checked.
  std::string ReadImageBytes(size_t i) const;

  struct Data;
  explicit Pack(std::shared_ptr<const Data> data) : data_(std::move(data)) {}

 private:
  std::shared_ptr<const Data> data_;
};

/// True for paths that OpenPack accepts: a folder with shards or an INDEX.json, or an HDF5 file.
bool IsPack(const std::string& path);

/// Opens a finished folder (INDEX.json) or one file of it. Throws IoError, or FormatError for damaged, foreign or hostile
/// files, for shards of different builds and for an unfinished folder.
Pack OpenPack(const std::string& path, const PackOpenOptions& options = {});

PackInfo ReadPackInfo(const std::string& path, const PackOpenOptions& options = {});

struct PackReport {
  PackInfo info;                  ///< of the readable parts
  int64_t images = 0, masks = 0;  ///< decoded
  std::vector<Finding> findings;  ///< codes PCK-INDEX, PCK-SHARD, PCK-DONE, PCK-IMAGE, PCK-MASK, PCK-TABLE, PCK-STRAY
  int num_errors() const;
};

/// Lists all defects of a pack: missing, damaged or unexpected shards, digests, every checksum, every image and mask
/// decoded, joints against their projection. Files are read in a separate process (see PackOpenOptions); a file that
/// crashes it or exceeds its time is a finding. Throws IoError when there is no pack at `path`.
PackReport VerifyPack(const std::string& path, const PackOpenOptions& options = {}, const RunContext& run = {});

}  // namespace mvstudio::dataset
