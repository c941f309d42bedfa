#include <cstring>
#include <sstream>

#include "core/hash/sha256.h"
#include "dataset/pack/image_codec.h"
#include "dataset/pack/pack.h"
#include "dataset/pack/shard.h"
#include "tests/fuzz/fuzz.h"

/// HDF5 shards. The library behind them is not instrumented, and its metadata carry checksums that mutations break: so one
/// target changes the content and lets the writer make a file of it, the other one changes bytes.
namespace mvstudio::fuzz {

namespace pack = dataset::internal;

namespace {

/// One image of one person, with a mask.
pack::Shard SmallShard() {
  pack::Shard shard;
  shard.camera = {0}, shard.frame = {5}, shard.person = {0}, shard.pose = {0};
  shard.univ_time_ms = {40}, shard.part = {1}, shard.size_px = {4, 3};
  shard.intrinsics = {5, 0, 1.5, 0, 5, 1, 0, 0, 1};
  shard.cam_from_world = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 2};
  shard.joints_px.assign(38, 1), shard.joint_in_view.assign(19, 1);
  shard.source_sha256.assign(32, 7), shard.mask_sha256.assign(32, 8);
  shard.pose_frame = {5}, shard.pose_person = {0};
  shard.joints_in_world.assign(57, 0.1), shard.confidence.assign(19, 0.5), shard.joint_valid.assign(19, 1);
  shard.blob_chunk = 4096;
  const Image image(4, 3, 3), mask(4, 3, 1);
  pack::AddToBlob(pack::EncodeImage(image, {dataset::PackCodec::Kind::kRaw, 0}), pack::EncodeMask(mask), &shard);
  return shard;
}

/// "TABLE PLACE NUMBER": one value of a table; a place behind its end adds rows, "TABLE cut ROWS" takes them away.
void Edit(const std::string& line, pack::Shard* shard) {
  std::istringstream in(line);
  std::string table, place, number;
  if (!(in >> table >> place >> number)) return;
  const long at = std::atol(place.c_str());
  const double value = std::strtod(number.c_str(), nullptr);
  pack::VisitTables(
      [&](const char* name, auto& column, const std::vector<uint64_t>& rest) {
        if (table != name + 1) return;
        using T = typename std::decay_t<decltype(column)>::value_type;
        size_t width = 1;
        for (const uint64_t side : rest) width *= side;
        if (place == "cut") {
          column.resize(std::min(column.size(), width * static_cast<size_t>(std::max(0l, std::atol(number.c_str())))));
        } else if (at >= 0 && at < 4096) {
          const auto index = static_cast<size_t>(at);
          if (index >= column.size()) column.resize((index / width + 1) * width);
          if constexpr (std::is_integral_v<T>) {
            column[index] = static_cast<T>(std::strtoll(number.c_str(), nullptr, 10));
          } else {
            column[index] = static_cast<T>(value);
          }
        }
      },
      *shard);
}

void CheckOpened(const dataset::Pack& opened) {
  for (size_t i = 0; i < opened.samples().size(); ++i) {
    const dataset::PackSample& sample = opened.samples()[i];
    Require(sample.camera_idx >= 0 && static_cast<size_t>(sample.camera_idx) < opened.rig().cameras.size(), "no such camera");
    Require(sample.joints_px.allFinite() && sample.pose.x_in_world.allFinite(), "joints that are no numbers");
    Accepts([&] {
      const Image image = opened.ReadImage(i);
      Require(image.width == sample.view.camera.width_px && image.height == sample.view.camera.height_px, "another size");
    });
    Accepts([&] { opened.ReadMask(i); });
  }
}

void Open(const std::string& path) {
  dataset::PackOpenOptions options;
  options.check_in_child = false;  // a crash is to be seen here
  std::optional<dataset::Pack> opened;
  if (Accepts([&] { opened = dataset::OpenPack(path, options); })) CheckOpened(*opened);
}

}  // namespace

/// Edits of the tables, the plan, the rig.
MVS_FUZZ_TARGET(shard_tables, bytes) {
  const auto parts = Parts(bytes, 3);
  pack::Shard shard = SmallShard();
  std::istringstream edits{std::string(parts[0])};
  for (std::string line; std::getline(edits, line);) Edit(line, &shard);
  shard.plan = parts[1];
  shard.rig = parts[2];
  const pack::FileImage file = pack::ShardToHdf5(shard, "shard");
  Open(Scratch("tables.h5", file.view()));
}

MVS_FUZZ_TARGET(shard_bytes, bytes) { Open(Scratch("bytes.h5", bytes)); }

}  // namespace mvstudio::fuzz
