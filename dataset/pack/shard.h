// Private: HDF5's types, for the .cc files of this folder.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "dataset/arrays/hdf5_reader.h"
#include "dataset/arrays/hdf5_writer.h"

/// One HDF5 file of a pack: its tables in memory, written and read.
namespace mvstudio::dataset::internal {

inline constexpr int64_t kMaxImagePx = int64_t{1} << 26;

/// Row i of every table of the first group is sample i; of the second, pose i. Encoded images and masks are in `blob`,
/// none across a chunk border.
struct Shard {
  std::string plan;    ///< JSON: options, cameras, digests of the inputs; equal in all shards of a pack
  std::string rig;     ///< calibration file (`mvstudio.calibration/1`)
  int32_t number = 0;  ///< of this shard
  int32_t num_shards = 1;

  std::vector<int32_t> camera;         // (N) index into the rig
  std::vector<int32_t> frame;          // (N)
  std::vector<int32_t> person;         // (N) -1: nobody's
  std::vector<int32_t> pose;           // (N) row of the poses, -1: none
  std::vector<double> univ_time_ms;    // (N)
  std::vector<uint8_t> part;           // (N) 0 none, 1 train, 2 validation, 3 test
  std::vector<int32_t> size_px;        // (N, 2) width, height
  std::vector<double> intrinsics;      // (N, 3, 3) K of the stored image
  std::vector<double> cam_from_world;  // (N, 3, 4) [R t] of the stored image, metres
  std::vector<double> joints_px;       // (N, 19, 2) in the stored image; 0 where not in view
  std::vector<uint8_t> joint_in_view;  // (N, 19)
  std::vector<uint64_t> image_offset, image_bytes, mask_offset, mask_bytes;  // (N) in the blob
  std::vector<uint32_t> image_crc32, mask_crc32;                             // (N)
  std::vector<uint8_t> source_sha256;                                        // (N, 32) of the image file
  std::vector<uint8_t> mask_sha256;                                          // (N, 32) of the mask file, 0 without

  std::vector<int32_t> pose_frame, pose_person;  // (M)
  std::vector<double> joints_in_world;           // (M, 19, 3) metres
  std::vector<double> confidence;                // (M, 19)
  std::vector<uint8_t> joint_valid;              // (M, 19)

  std::vector<uint8_t> blob;
  uint64_t blob_chunk = 0;  ///< bytes

  size_t size() const { return frame.size(); }
};

/// The single list of tables: calls visit("samples/frame", column, {dimensions after the first}).
template <class Visitor, class ShardType>
void VisitTables(Visitor&& visit, ShardType& s) {
  using Dims = std::vector<uint64_t>;
  visit("/samples/camera", s.camera, Dims{});
  visit("/samples/frame", s.frame, Dims{});
  visit("/samples/person", s.person, Dims{});
  visit("/samples/pose", s.pose, Dims{});
  visit("/samples/univ_time_ms", s.univ_time_ms, Dims{});
  visit("/samples/part", s.part, Dims{});
  visit("/samples/size_px", s.size_px, Dims{2});
  visit("/samples/K", s.intrinsics, Dims{3, 3});
  visit("/samples/cam_from_world", s.cam_from_world, Dims{3, 4});
  visit("/samples/joints_px", s.joints_px, Dims{19, 2});
  visit("/samples/joint_in_view", s.joint_in_view, Dims{19});
  visit("/samples/image_offset", s.image_offset, Dims{});
  visit("/samples/image_bytes", s.image_bytes, Dims{});
  visit("/samples/image_crc32", s.image_crc32, Dims{});
  visit("/samples/mask_offset", s.mask_offset, Dims{});
  visit("/samples/mask_bytes", s.mask_bytes, Dims{});
  visit("/samples/mask_crc32", s.mask_crc32, Dims{});
  visit("/samples/source_sha256", s.source_sha256, Dims{32});
  visit("/samples/mask_sha256", s.mask_sha256, Dims{32});
  visit("/poses/frame", s.pose_frame, Dims{});
  visit("/poses/person", s.pose_person, Dims{});
  visit("/poses/joints_in_world", s.joints_in_world, Dims{19, 3});
  visit("/poses/confidence", s.confidence, Dims{19});
  visit("/poses/valid", s.joint_valid, Dims{19});
}

/// Adds the encoded image and mask (empty: none) of the sample whose other columns were just added. The sizes of all
/// samples must be known before: see ChooseBlobChunk.
void AddToBlob(std::string_view image, std::string_view mask, Shard* shard);
/// A chunk size that holds every pair of image and mask, with little space wasted at its end.
uint64_t ChooseBlobChunk(uint64_t largest_pair_bytes);

/// Digest of everything but the blob, whose pieces are represented by their CRC-32.
std::string ContentSha256(const Shard& shard);

FileImage ShardToHdf5(const Shard& shard, const std::string& label);

enum class ShardPart { kTables, kAll };
struct ReadShardResult {
  Shard shard;  ///< `blob` only with kAll
  std::string content_sha256;
  Hdf5Reader::Chunks blob_chunks;
  uint64_t blob_bytes = 0, file_bytes = 0;
};
/// Checks the structure, then every table: sizes, ranges, finite numbers, digest; with kAll also the blob's checksums. Throws
/// FormatError.
ReadShardResult ReadShard(const std::string& path, ShardPart part);

/// True when the contents are equal, including the blob.
bool SameContent(const Shard& a, const Shard& b);

/// All samples and poses of the shards of one plan, in order.
Shard Concatenate(const std::vector<Shard>& shards);

}  // namespace mvstudio::dataset::internal
