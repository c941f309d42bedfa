// Private: other programs on the same data, for run.cc.
#pragma once

#include <string>
#include <vector>

#include "stages/fronts/plan.h"

namespace mvstudio::stages {

/// Calls `program` as PROGRAM STAGE session=S take=T calib=FILE out=FOLDER threads=N and reads its stdout: a JSON
/// list of objects with name, command, seconds, processor_seconds, peak_rss_mb, error (that of the stage's front), or why_not.
/// A program that fails is one way that says so.
std::vector<FrontWay> PeerWays(const std::string& program, const std::string& stage, const FrontsMaterial& material);

}  // namespace mvstudio::stages
