#include "dataset/pack/pack.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>

#include "core/check.h"
#include "core/disk/lock.h"
#include "core/error.h"
#include "dataset/pack/image_codec.h"
#include "dataset/pack/pack_data.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;

PackFile::PackFile(std::string path, const internal::Hdf5Reader::Chunks& chunks) : path_(std::move(path)), chunks_(chunks) {
  fd_ = open(path_.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd_ < 0) throw IoError(path_, std::string("cannot open: ") + std::strerror(errno));
}

PackFile::PackFile(PackFile&& other) noexcept
    : path_(std::move(other.path_)), fd_(other.fd_), chunks_(std::move(other.chunks_)) {
  other.fd_ = -1;
}

PackFile::~PackFile() {
  if (fd_ >= 0) close(fd_);
}

std::string PackFile::Read(uint64_t offset, uint64_t bytes) const {
  std::string data(bytes, '\0');
  if (bytes == 0) return data;
  const uint64_t chunk = offset / chunks_.chunk_bytes;
  MVS_CHECK(chunk < chunks_.chunks.size() && offset % chunks_.chunk_bytes + bytes <= chunks_.chunk_bytes, "offset " << offset);
  uint64_t at = chunks_.chunks[chunk].file_offset + offset % chunks_.chunk_bytes;
  size_t done = 0;
  while (done < bytes) {
    const ssize_t count = pread(fd_, data.data() + done, bytes - done, static_cast<off_t>(at + done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw IoError(path_, std::string("cannot read: ") + std::strerror(errno));
    if (count == 0) throw FormatError(path_, "/blob", "ends early: the file was cut off while it was open");
    done += static_cast<size_t>(count);
  }
  return data;
}

namespace internal {
namespace {

geometry::RigCamera ViewOf(const Shard& s, size_t i, const geometry::RigCamera& source, PackView view) {
  if (view == PackView::kFull) return source;
  geometry::RigCamera camera;
  camera.camera.name = source.camera.name;
  camera.camera.model = geometry::LensModel::kPinhole;
  camera.camera.width_px = s.size_px[2 * i], camera.camera.height_px = s.size_px[2 * i + 1];
  const double* k = s.intrinsics.data() + 9 * i;
  camera.camera.params = Eigen::Vector4d(k[0], k[4], k[2], k[5]);
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> pose(s.cam_from_world.data() + 12 * i);
  camera.cam_from_world.rotation = geometry::NearestRotation(pose.leftCols<3>());
  camera.cam_from_world.translation = pose.col(3);
  return camera;
}

Coco19Pose PoseOf(const Shard& s, int32_t row) {
  Coco19Pose pose;
  for (int j = 0; row >= 0 && j < 19; ++j) {
    const size_t at = static_cast<size_t>(row) * 19 + j;
    for (int k = 0; k < 3; ++k) pose.x_in_world(k, j) = s.joints_in_world[3 * at + k];
    pose.valid[j] = s.joint_valid[at] != 0;
    pose.confidence[j] = s.confidence[at];
  }
  return pose;
}

void RequireCamera(const std::string& path, const Shard& s, size_t i, const geometry::Rig& rig, PackView view) {
  const std::string where = "/samples/camera[" + std::to_string(i) + "]";
  if (s.camera[i] >= static_cast<int32_t>(rig.cameras.size())) throw FormatError(path, where, "is not in the rig");
  const geometry::Camera& camera = rig.cameras[s.camera[i]].camera;
  if (view == PackView::kFull && (s.size_px[2 * i] != camera.width_px || s.size_px[2 * i + 1] != camera.height_px)) {
    throw FormatError(path, "/samples/size_px[" + std::to_string(i) + "]", "is not the size of the rig's camera");
  }
}

PackSample SampleOf(const Shard& s, size_t i, const geometry::Rig& rig, PackView view) {
  PackSample sample;
  sample.camera_idx = s.camera[i];
  sample.frame = s.frame[i];
  sample.univ_time_ms = s.univ_time_ms[i];
  sample.person = s.person[i];
  sample.view = ViewOf(s, i, rig.cameras[s.camera[i]], view);
  sample.pose = PoseOf(s, s.pose[i]);
  for (int j = 0; j < 19; ++j) {
    sample.joints_px.col(j) << s.joints_px[38 * i + 2 * j], s.joints_px[38 * i + 2 * j + 1];
    sample.in_view[j] = s.joint_in_view[19 * i + j] != 0;
  }
  sample.part = static_cast<PartOfSplit>(s.part[i]);
  sample.has_mask = s.mask_bytes[i] > 0;
  return sample;
}

void ReadPlan(const std::string& path, const Shard& shard, Pack::Data* data) {
  const Json json = ParseJson(shard.plan, path + ": /plan");
  const std::string name = path + ": /plan";
  const JsonView plan(name, json);
  PackInfo& info = data->info;
  info.plan_json = shard.plan;
  info.sequence = plan["sequence"].Text();
  info.image_codec = plan["codec"].Text();
  info.mask_codec = plan["mask_codec"].Text();
  const std::string view = plan["view"].Text();
  if (view != "crop" && view != "full" && view != "undistorted") plan["view"].Fail("must be crop, full or undistorted");
  info.view = view == "crop" ? PackView::kCrop : view == "full" ? PackView::kFull : PackView::kUndistorted;
  try {
    FromString(info.image_codec, &data->codec);
  } catch (const UsageError&) {
    plan["codec"].Fail("must be png, raw or jpeg:Q");
  }
  data->rig = geometry::RigFromJsonText(shard.rig, path + ": /rig");
}

std::string HeadBytes(const std::string& path) {
  if (!fs::is_regular_file(path)) return {};
  std::ifstream in(path, std::ios::binary);
  char head[8] = "";
  in.read(head, sizeof(head));
  return {head, static_cast<size_t>(in.gcount())};
}

}  // namespace

ChildLimits LimitsOf(const PackOpenOptions& options, uint64_t file_bytes, bool whole_file) {
  constexpr double kSlowestBytesPerS = 4e6;
  ChildLimits limits{options.deadline_s, options.max_memory_bytes};
  if (whole_file) {
    limits.deadline_s += static_cast<double>(file_bytes) / kSlowestBytesPerS;
    limits.max_memory_bytes += 2 * file_bytes;
  }
  return limits;
}

ReadShardResult ReadShardCarefully(const std::string& path, const PackOpenOptions& options) {
  RequireNoWriter(path);
  if (options.check_in_child) {
    RunInChild(path, LimitsOf(options, 0, false), [&] {
      ReadShard(path, ShardPart::kTables);
      return std::string();
    });
  }
  return ReadShard(path, ShardPart::kTables);
}

void AddShard(const std::string& path, const ReadShardResult& read, Pack::Data* data) {
  const Shard& shard = read.shard;
  if (data->files.empty()) {
    ReadPlan(path, shard, data);
  } else if (shard.plan != data->info.plan_json) {
    throw FormatError(path, "/plan", "is not that of " + data->files[0].path() + ": shards of different packs");
  }
  const int file = static_cast<int>(data->files.size());
  data->files.emplace_back(path, read.blob_chunks);
  for (size_t i = 0; i < shard.size(); ++i) {
    RequireCamera(path, shard, i, data->rig, data->info.view);
    data->samples.push_back(SampleOf(shard, i, data->rig, data->info.view));
    data->places.push_back({file,
                            i,
                            {shard.image_offset[i], shard.image_bytes[i], shard.image_crc32[i]},
                            {shard.mask_offset[i], shard.mask_bytes[i], shard.mask_crc32[i]}});
  }
  data->info.bytes += read.file_bytes;
}

void Summarise(Pack::Data* data) {
  std::set<int> cameras, frames, people;
  std::set<std::pair<int, int>> sizes;
  for (const PackSample& s : data->samples) {
    cameras.insert(s.camera_idx), frames.insert(s.frame);
    if (s.person >= 0) people.insert(s.person);
    sizes.insert({s.view.camera.width_px, s.view.camera.height_px});
  }
  PackInfo& info = data->info;
  info.shards = static_cast<int>(data->files.size());
  info.samples = static_cast<int64_t>(data->samples.size());
  info.cameras = static_cast<int>(cameras.size());
  info.frames = static_cast<int>(frames.size());
  info.people = static_cast<int>(people.size());
  if (sizes.size() == 1) std::tie(info.width_px, info.height_px) = *sizes.begin();
}

}  // namespace internal

bool IsPack(const std::string& path) {
  if (!fs::is_directory(path)) return internal::HeadBytes(path) == std::string("\x89HDF\r\n\x1a\n", 8);
  if (fs::exists(path + "/" + internal::kIndexName)) return true;
  for (const auto& entry : fs::directory_iterator(path)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind("shard-", 0) == 0 && entry.path().extension() == ".h5") return true;
  }
  return false;
}

Pack OpenPack(const std::string& path, const PackOpenOptions& options) {
  auto data = std::make_shared<Pack::Data>();
  data->info.path = path;
  if (!fs::is_directory(path)) {
    if (!fs::exists(path)) throw IoError(path, "no such file or folder");
    internal::AddShard(path, internal::ReadShardCarefully(path, options), data.get());
  } else {
    const std::string index_path = path + "/" + internal::kIndexName;
    if (!fs::exists(index_path)) {
      throw FormatError(path, "",
                        IsPack(path) ? "is not finished: no INDEX.json; run dataset pack option 'merge'"
                                     : "is no pack: neither INDEX.json nor shards in it");
    }
    for (const internal::DoneMarker& done : internal::ReadIndex(index_path).shards) {
      const std::string file = path + "/" + done.file;
      const internal::ReadShardResult read = internal::ReadShardCarefully(file, options);
      if (read.content_sha256 != done.content_sha256) {
        throw FormatError(file, "", "is not the shard that INDEX.json names; run dataset pack again, then option 'merge'");
      }
      internal::AddShard(file, read, data.get());
    }
  }
  data->info.complete = true;
  internal::Summarise(data.get());
  return Pack(data);
}

PackInfo ReadPackInfo(const std::string& path, const PackOpenOptions& options) { return OpenPack(path, options).info(); }

const PackInfo& Pack::info() const { return data_->info; }
const geometry::Rig& Pack::rig() const { return data_->rig; }
const std::vector<PackSample>& Pack::samples() const { return data_->samples; }

namespace {

std::string ReadPiece(const Pack::Data& data, size_t i, bool mask, std::string* where) {
  MVS_CHECK(i < data.places.size(), "sample " << i << " of " << data.places.size());
  const Pack::Data::Place& place = data.places[i];
  const Pack::Data::Piece& piece = mask ? place.mask : place.image;
  const PackFile& file = data.files[place.file];
  *where = std::string(mask ? "mask" : "image") + " of sample " + std::to_string(place.row);
  std::string bytes = file.Read(piece.offset, piece.bytes);
  if (internal::Crc32(bytes) != piece.crc32) {
    throw FormatError(file.path(), *where, "does not match its checksum: the file is damaged; make the shard again");
  }
  return bytes;
}

}  // namespace

std::string Pack::ReadImageBytes(size_t i) const {
  std::string where;
  return ReadPiece(*data_, i, false, &where);
}

Image Pack::ReadImage(size_t i) const {
  std::string where;
  const std::string bytes = ReadPiece(*data_, i, false, &where);
  const geometry::Camera& view = data_->samples[i].view.camera;
  return internal::DecodeImage(bytes, data_->codec, view.width_px, view.height_px, data_->files[data_->places[i].file].path(),
                               where);
}

Image Pack::ReadMask(size_t i) const {
  std::string where;
  const std::string bytes = ReadPiece(*data_, i, true, &where);
  if (bytes.empty()) return {};
  const geometry::Camera& view = data_->samples[i].view.camera;
  return internal::DecodeMask(bytes, view.width_px, view.height_px, data_->files[data_->places[i].file].path(), where);
}

}  // namespace mvstudio::dataset
