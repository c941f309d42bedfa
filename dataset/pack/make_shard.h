// Private: a step of BuildPack.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/pack/plan.h"
#include "dataset/pack/shard.h"

namespace mvstudio::dataset::internal {

struct MadeShard {
  Shard shard;
  std::string inputs_sha256;         ///< as from InputsSha256
  std::vector<std::string> skipped;  ///< images that do not exist
  PackTimes times;
};

/// Shared by all shards of a plan and computed once.
struct ShardTools {
  std::map<int, Undistorter> undistorters;  ///< by camera_idx
};
ShardTools MakeShardTools(const PackPlan& plan);

/// Reads, resamples and encodes the images of one shard. Throws IoError / FormatError for damaged files; missing ones
/// are skipped.
MadeShard MakeShard(const PackPlan& plan, const ShardTools& tools, int number, const RunContext& run);

/// Digest of the current images and masks of a shard.
std::string InputsSha256(const PackPlan& plan, int number, const RunContext& run);

}  // namespace mvstudio::dataset::internal
