#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/pack/plan_internal.h"
#include "dataset/pack/shard_internal.h"

namespace mvstudio::dataset::internal {

struct MadeShard {
  Shard shard;
  std::string inputs_sha256;         ///< as InputsSha256 gives it
  std::vector<std::string> skipped;  ///< pictures that are not there
  PackTimes times;
};

/// What all shards of a plan share and is worked out once.
struct ShardTools {
  std::map<int, Undistorter> undistorters;  ///< by camera_idx
};
ShardTools MakeShardTools(const PackPlan& plan);

/// Reads, resamples and encodes the pictures of one shard. Throws IoError / FormatError for damaged files; missing ones are
/// skipped.
MadeShard MakeShard(const PackPlan& plan, const ShardTools& tools, int number, const RunContext& run);

/// Digest of the pictures and masks that a shard is made of, as they are now.
std::string InputsSha256(const PackPlan& plan, int number, const RunContext& run);

}  // namespace mvstudio::dataset::internal
