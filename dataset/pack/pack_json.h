// Private: JSON files that only this folder writes and reads.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dataset/json/json_file.h"

/// The JSON files of a pack: one done-marker beside each shard, and the index.
namespace mvstudio::dataset::internal {

inline constexpr char kDoneSchema[] = "mvstudio.pack-shard/1";
inline constexpr char kIndexSchema[] = "mvstudio.pack-index/1";
inline constexpr char kIndexName[] = "INDEX.json";

/// State of a finished shard.
struct DoneMarker {
  std::string file;  ///< name in the folder
  uint64_t bytes = 0;
  std::string sha256, content_sha256, plan_sha256, inputs_sha256;
  int number = 0, num_shards = 0;
  int64_t samples = 0;
  std::vector<std::string> skipped;
};

std::string ShardStem(int number);  ///< "shard-00007"
std::string ShardPath(const std::string& folder, int number);
std::string DonePath(const std::string& folder, int number);

std::string DoneToJsonText(const DoneMarker& marker);
/// Empty when the file does not exist. Throws FormatError.
std::optional<DoneMarker> ReadDone(const std::string& path);

struct PackIndex {
  std::string plan_sha256;
  Json plan;
  std::vector<DoneMarker> shards;
};
std::string IndexToJsonText(const PackIndex& index);
PackIndex ReadIndex(const std::string& path);

}  // namespace mvstudio::dataset::internal
