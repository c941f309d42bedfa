#pragma once

#include <optional>
#include <string>
#include <vector>

#include "avatar/metrics_set.h"
#include "core/progress.h"

namespace mvstudio::avatar {

struct FolderComparison {
  struct Picture {
    std::string name;
    RegionScore score;  ///< over the whole picture
  };
  std::vector<Picture> pictures;  ///< by name
  RegionScore mean;               ///< PSNR: mean of the finite dB
  int64_t psnr_infinite = 0;      ///< equal pairs
  std::optional<SetDistance> fd;  ///< missing below 4 pairs, for pictures under 32 px or of several sizes
  std::string fd_missing;         ///< why it is missing
  std::vector<std::string> only_in_reference, only_in_other;  ///< file names without a partner
};

/// Compares the PNG and JPEG files of two folders that have the same name (without extension). Throws IoError when a folder is
/// missing or nothing matches, FormatError for unreadable pictures or a pair of different sizes.
FolderComparison CompareFolders(const std::string& reference, const std::string& other, const RunContext& run);

/// Distance between two sets of features kept in safetensors files as a tensor `features` (n, d), d equal. `features` of the
/// result is the file's metadata entry `features`, "unnamed" without one.
SetDistance CompareFeatureFiles(const std::string& reference, const std::string& other, const RunContext& run);

}  // namespace mvstudio::avatar
