#pragma once

#include <string>
#include <vector>

#include "stages/avatar_compare/options.h"
#include "stages/study/avatar_table.h"

namespace mvstudio::stages {

struct AvatarCompareReport {
  AvatarCompareOptions options;
  Comparison comparison;
  std::string protocol_sha256;          ///< that all runs share
  std::vector<std::string> not_judged;  ///< what the answers judge, and no row is called
};

/// Throws UsageError for runs that cannot stand in one table, IoError and FormatError.
AvatarCompareReport RunAvatarCompare(const AvatarCompareOptions& options);

}  // namespace mvstudio::stages
