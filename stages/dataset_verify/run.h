#pragma once

#include <string>

#include "core/disk/kept.h"
#include "core/progress.h"
#include "dataset/verify/verify.h"
#include "stages/result.h"

/// The check of a dataset, which several processes can share.
namespace mvstudio::stages {

/// Checks of single cameras that are kept, for a check of the same dataset with the same options.
struct DatasetVerifyKept {
  CachePlace cache{CachePlace::Kind::kOff, ""};
  std::string part;    ///< share=K/N of the cameras, kept in `cache`; empty: all, and what `cache` has is not looked at again
  std::string folder;  ///< for the list of what a part kept
};

/// As VerifyDatasetOrPack; a part is a list of what it kept. Throws UsageError for a part of a pack, or without a cache.
CommandResult RunDatasetVerify(const std::string& path, const dataset::VerifyOptions& options, const DatasetVerifyKept& kept,
                               const RunContext& run);

}  // namespace mvstudio::stages
