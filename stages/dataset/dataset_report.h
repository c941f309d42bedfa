#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/verify/verify.h"
#include "stages/result.h"

/// Content and defects of a dataset, a pack or a session.
namespace mvstudio::stages {

/// Lists all defects of a folder in Panoptic layout or a pack: exit 6 when parts are bad, 3 when everything is. Throws
/// UsageError for a session.
CommandResult VerifyDatasetOrPack(const std::string& path, const dataset::VerifyOptions& options, const RunContext& run,
                                  const dataset::KeptChecks& kept = {});

/// Describes a session, a folder in Panoptic layout or a pack.
CommandResult DescribeDataset(const std::string& path);

/// Findings as metrics.findings, errors and warnings.
CommandResult DescribeDatasetFindings(const std::vector<dataset::Finding>& findings);

}  // namespace mvstudio::stages
