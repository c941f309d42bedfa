#include <algorithm>
#include <cstring>

#include "core/check.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "dataset/pack/image_codec.h"
#include "dataset/pack/pack.h"
#include "dataset/pack/shard.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr uint64_t kPage = 4096;

// Rows of a table: its length over the product of the other dimensions.
template <class T>
std::vector<uint64_t> DimsOf(const std::vector<T>& column, const std::vector<uint64_t>& rest) {
  uint64_t row = 1;
  for (const uint64_t d : rest) row *= d;
  std::vector<uint64_t> dims = {column.size() / row};
  dims.insert(dims.end(), rest.begin(), rest.end());
  return dims;
}

std::string_view Piece(const Shard& shard, uint64_t offset, uint64_t bytes) {
  return {reinterpret_cast<const char*>(shard.blob.data()) + offset, bytes};
}

uint64_t LargestPair(const Shard& shard) {
  uint64_t largest = 0;
  for (size_t i = 0; i < shard.size(); ++i) largest = std::max(largest, shard.image_bytes[i] + shard.mask_bytes[i]);
  return largest;
}

std::string ShardName(const Shard& shard) { return "shard " + std::to_string(shard.number); }

// All but those that AddToBlob fills.
void AppendTables(const Shard& from, Shard* to) {
  std::vector<const void*> sources;
  VisitTables([&](const char*, const auto& column, const auto&) { sources.push_back(&column); }, from);
  size_t k = 0;
  VisitTables(
      [&](const char* name, auto& column, const auto&) {
        const auto& more = *static_cast<const std::decay_t<decltype(column)>*>(sources[k++]);
        const std::string table(name);
        const bool of_blob = table.rfind("/samples/image_", 0) == 0 || table == "/samples/mask_offset" ||
                             table == "/samples/mask_bytes" || table == "/samples/mask_crc32";
        if (!of_blob) column.insert(column.end(), more.begin(), more.end());
      },
      *to);
}

}  // namespace

uint64_t ChooseBlobChunk(uint64_t largest_pair_bytes) {
  const uint64_t several = std::min<uint64_t>(4 * largest_pair_bytes, 32 << 20);
  const uint64_t wanted = std::max<uint64_t>({largest_pair_bytes, several, 64 << 10});
  return (wanted + kPage - 1) / kPage * kPage;
}

void AddToBlob(std::string_view image, std::string_view mask, Shard* shard) {
  const uint64_t bytes = image.size() + mask.size();
  MVS_CHECK(bytes <= shard->blob_chunk, bytes << " bytes for chunks of " << shard->blob_chunk);
  std::vector<uint8_t>& blob = shard->blob;
  const uint64_t left = shard->blob_chunk - blob.size() % shard->blob_chunk;
  if (bytes > left) blob.resize(blob.size() + left, 0);
  shard->image_offset.push_back(blob.size());
  blob.insert(blob.end(), image.begin(), image.end());
  shard->mask_offset.push_back(blob.size());
  blob.insert(blob.end(), mask.begin(), mask.end());
  shard->image_bytes.push_back(image.size());
  shard->mask_bytes.push_back(mask.size());
  shard->image_crc32.push_back(Crc32(image));
  shard->mask_crc32.push_back(Crc32(mask));
}

std::string ContentSha256(const Shard& shard) {
  Sha256 digest;
  const auto add = [&](const std::string& name, const void* data, uint64_t bytes) {
    const std::string head = name + " " + std::to_string(bytes) + "\n";
    digest.Update(head.data(), head.size());
    if (bytes > 0) digest.Update(data, bytes);
  };
  add("plan", shard.plan.data(), shard.plan.size());
  add("rig", shard.rig.data(), shard.rig.size());
  const std::string numbers = std::to_string(shard.number) + " " + std::to_string(shard.num_shards);
  add("shard", numbers.data(), numbers.size());
  VisitTables(
      [&](const char* name, const auto& column, const auto&) { add(name, column.data(), column.size() * sizeof(column[0])); },
      shard);
  return digest.HexDigest();
}

FileImage ShardToHdf5(const Shard& shard, const std::string& label) {
  Hdf5Writer writer(label);
  writer.Attribute("/", "schema", kPackSchema);
  writer.Attribute("/", "plan_sha256", Sha256Hex(shard.plan.data(), shard.plan.size()));
  writer.Attribute("/", "content_sha256", ContentSha256(shard));
  writer.Attribute("/", "shard", shard.number);
  writer.Attribute("/", "num_shards", shard.num_shards);
  VisitTables(
      [&](const char* name, const auto& column, const auto& rest) { writer.Array(name, DimsOf(column, rest), column.data()); },
      shard);
  const auto text = [&](const char* name, const std::string& value) {
    writer.Array(name, {value.size()}, reinterpret_cast<const uint8_t*>(value.data()));
  };
  text("/plan", shard.plan);
  text("/rig", shard.rig);
  // The last chunk is filled up in the file as well: all pieces then have the same place in their chunk on disk.
  std::vector<uint8_t> padded;
  const std::vector<uint8_t>* blob = &shard.blob;
  if (!shard.blob.empty() && shard.blob.size() < shard.blob_chunk) {
    padded = shard.blob;
    padded.resize(shard.blob_chunk, 0);
    blob = &padded;
  }
  ArrayLayout layout;
  if (!blob->empty()) layout.chunk = {shard.blob_chunk};
  writer.Array("/blob", {blob->size()}, blob->data(), layout);
  return writer.Finish();
}

bool SameContent(const Shard& a, const Shard& b) {
  bool same = ContentSha256(a) == ContentSha256(b);
  for (size_t i = 0; same && i < a.size(); ++i) {
    same = Piece(a, a.image_offset[i], a.image_bytes[i]) == Piece(b, b.image_offset[i], b.image_bytes[i]) &&
           Piece(a, a.mask_offset[i], a.mask_bytes[i]) == Piece(b, b.mask_offset[i], b.mask_bytes[i]);
  }
  return same;
}

Shard Concatenate(const std::vector<Shard>& shards) {
  MVS_CHECK(!shards.empty(), "no shards");
  Shard all;
  all.plan = shards[0].plan, all.rig = shards[0].rig;
  uint64_t largest = 0;
  for (const Shard& shard : shards) {
    MVS_CHECK(shard.plan == all.plan && shard.rig == all.rig, "shards of different packs");
    largest = std::max(largest, LargestPair(shard));
  }
  // Offsets are worked out anew: the chunk has to hold the largest pair of all.
  all.blob_chunk = ChooseBlobChunk(largest);
  for (const Shard& shard : shards) {
    const size_t first = all.size();
    const auto num_poses = static_cast<int32_t>(all.pose_frame.size());
    AppendTables(shard, &all);
    for (size_t i = first; i < all.size(); ++i) {
      if (all.pose[i] >= 0) all.pose[i] += num_poses;
    }
    for (size_t i = 0; i < shard.size(); ++i) {
      AddToBlob(Piece(shard, shard.image_offset[i], shard.image_bytes[i]),
                Piece(shard, shard.mask_offset[i], shard.mask_bytes[i]), &all);
      if (all.image_crc32.back() != shard.image_crc32[i] || all.mask_crc32.back() != shard.mask_crc32[i]) {
        throw FormatError(ShardName(shard), "samples[" + std::to_string(i) + "]", "does not match its checksum");
      }
    }
  }
  return all;
}

}  // namespace mvstudio::dataset::internal
