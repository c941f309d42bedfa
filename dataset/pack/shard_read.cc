#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/hash/sha256.h"
#include "dataset/pack/image_codec.h"
#include "dataset/pack/pack.h"
#include "dataset/pack/shard.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr uint64_t kMaxSamples = 1 << 24;
constexpr uint64_t kMaxTextBytes = 64 << 20;

std::string ReadText(const Hdf5Reader& file, const std::string& name) {
  const std::vector<uint64_t> dims = file.Dims(name);
  if (dims.size() != 1 || dims[0] > kMaxTextBytes) throw FormatError(file.path(), name, "is no text of reasonable length");
  const std::vector<uint8_t> bytes = file.Array<uint8_t>(name);
  return {bytes.begin(), bytes.end()};
}

uint64_t ReadCount(const Hdf5Reader& file, const std::string& table) {
  const std::vector<uint64_t> dims = file.Dims(table);
  if (dims.size() != 1 || dims[0] > kMaxSamples) throw FormatError(file.path(), table, "has an impossible size");
  return dims[0];
}

void ReadTables(const Hdf5Reader& file, Shard* shard) {
  const uint64_t samples = ReadCount(file, "/samples/frame"), poses = ReadCount(file, "/poses/frame");
  VisitTables(
      [&](const char* name, auto& column, const std::vector<uint64_t>& rest) {
        using T = typename std::decay_t<decltype(column)>::value_type;
        std::vector<uint64_t> dims = {std::string(name).rfind("/samples/", 0) == 0 ? samples : poses};
        dims.insert(dims.end(), rest.begin(), rest.end());
        column = file.Array<T>(name, dims);
      },
      *shard);
}

/// Ranges of every table; the messages name the row.
class TableCheck {
 public:
  TableCheck(const std::string& path, const Shard& shard, uint64_t blob_bytes) : path_(path), s_(shard), blob_(blob_bytes) {}

  void Run() const {
    for (size_t i = 0; i < s_.pose_frame.size(); ++i) Pose(i);
    for (size_t i = 0; i < s_.size(); ++i) {
      Sample(i);
      View(i);
      Piece("image", i, s_.image_offset[i], s_.image_bytes[i], 1);
      Piece("mask", i, s_.mask_offset[i], s_.mask_bytes[i], 0);
    }
  }

 private:
  void Require(bool holds, const char* table, size_t row, const char* what) const {
    if (!holds) throw FormatError(path_, "/" + std::string(table) + "[" + std::to_string(row) + "]", what);
  }

  template <class T>
  static bool AllFinite(const std::vector<T>& column, size_t row, size_t width) {
    return std::all_of(column.begin() + row * width, column.begin() + (row + 1) * width, [](T v) { return std::isfinite(v); });
  }
  static bool AllFlags(const std::vector<uint8_t>& column, size_t row) {
    return std::all_of(column.begin() + row * 19, column.begin() + (row + 1) * 19, [](uint8_t v) { return v <= 1; });
  }

  void Pose(size_t i) const {
    Require(s_.pose_frame[i] >= 0 && s_.pose_person[i] >= 0, "poses", i, "has a negative frame or person");
    Require(AllFlags(s_.joint_valid, i), "poses/valid", i, "must be 0 or 1");
    Require(AllFinite(s_.joints_in_world, i, 57) && AllFinite(s_.confidence, i, 19), "poses", i,
            "holds numbers that are not finite");
  }

  void Sample(size_t i) const {
    Require(s_.camera[i] >= 0, "samples/camera", i, "must not be negative");
    Require(s_.frame[i] >= 0 && s_.person[i] >= -1, "samples", i, "has a negative frame or person");
    Require(s_.part[i] <= 3, "samples/part", i, "must be 0, 1, 2 or 3");
    Require(std::isfinite(s_.univ_time_ms[i]), "samples/univ_time_ms", i, "must be finite");
    const int32_t pose = s_.pose[i];
    Require(pose >= -1 && pose < static_cast<int64_t>(s_.pose_frame.size()), "samples/pose", i, "names no row of the poses");
    Require((pose < 0) == (s_.person[i] < 0), "samples/pose", i, "does not go with the person");
    if (pose < 0) return;
    Require(s_.pose_frame[pose] == s_.frame[i] && s_.pose_person[pose] == s_.person[i], "samples/pose", i,
            "is the pose of another frame or person");
  }

  void View(size_t i) const {
    const int64_t width = s_.size_px[2 * i], height = s_.size_px[2 * i + 1];
    Require(width > 0 && height > 0 && width <= kMaxImagePx && height <= kMaxImagePx && width * height <= kMaxImagePx,
            "samples/size_px", i, "is no size of an image");
    const double* k = s_.intrinsics.data() + 9 * i;
    const bool form = k[1] == 0 && k[3] == 0 && k[6] == 0 && k[7] == 0 && k[8] == 1 && k[0] > 0 && k[4] > 0;
    Require(AllFinite(s_.intrinsics, i, 9) && form, "samples/K", i, "is no camera matrix without skew");
    Require(AllFinite(s_.cam_from_world, i, 12), "samples/cam_from_world", i, "must be finite");
    const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> pose(s_.cam_from_world.data() + 12 * i);
    const Eigen::Matrix3d r = pose.leftCols<3>();
    const bool rotation = (r * r.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-9 && r.determinant() > 0;
    Require(rotation, "samples/cam_from_world", i, "holds no rotation");
    Require(AllFinite(s_.joints_px, i, 38), "samples/joints_px", i, "must be finite");
    Require(AllFlags(s_.joint_in_view, i), "samples/joint_in_view", i, "must be 0 or 1");
  }

  void Piece(const char* what, size_t i, uint64_t offset, uint64_t bytes, uint64_t least) const {
    const bool inside = bytes >= least && offset <= blob_ && bytes <= blob_ - offset;
    Require(inside, "samples", i, what[0] == 'i' ? "has an image outside the blob" : "has a mask outside the blob");
    const bool one_chunk = bytes == 0 || (s_.blob_chunk > 0 && offset / s_.blob_chunk == (offset + bytes - 1) / s_.blob_chunk);
    Require(one_chunk, "samples", i, "has data across two chunks of the blob");
  }

  const std::string& path_;
  const Shard& s_;
  const uint64_t blob_;
};

void CheckHead(const Hdf5Reader& file, Shard* shard) {
  if (!file.HasAttribute("/", "schema")) throw FormatError(file.path(), "", "is an HDF5 file, but no pack of mvstudio");
  const std::string schema = file.TextAttribute("/", "schema");
  if (schema != kPackSchema)
    throw FormatError(file.path(), "@schema", "is '" + schema.substr(0, 60) + "', " + kPackSchema + " is read");
  shard->number = file.Attribute<int32_t>("/", "shard");
  shard->num_shards = file.Attribute<int32_t>("/", "num_shards");
  if (shard->number < 0 || shard->number >= shard->num_shards)
    throw FormatError(file.path(), "@shard", "is not below @num_shards");
}

}  // namespace

ReadShardResult ReadShard(const std::string& path, ShardPart part) {
  const Hdf5Reader file(path);
  ReadShardResult result;
  Shard& shard = result.shard;
  CheckHead(file, &shard);
  shard.plan = ReadText(file, "/plan");
  shard.rig = ReadText(file, "/rig");
  ReadTables(file, &shard);
  result.blob_chunks = file.ByteChunks("/blob");
  shard.blob_chunk = result.blob_chunks.chunk_bytes;
  result.blob_bytes = file.Dims("/blob").at(0);
  result.file_bytes = file.file_bytes();
  TableCheck(path, shard, result.blob_bytes).Run();
  result.content_sha256 = ContentSha256(shard);
  if (file.TextAttribute("/", "content_sha256") != result.content_sha256) {
    throw FormatError(path, "@content_sha256", "is not that of the tables: the file was changed");
  }
  if (part == ShardPart::kAll) shard.blob = file.Array<uint8_t>("/blob");
  return result;
}

}  // namespace mvstudio::dataset::internal
