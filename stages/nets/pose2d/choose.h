#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "geometry/rig/rig.h"
#include "stages/nets/pose2d/detect.h"
#include "stages/nets/pose2d/options.h"
#include "stages/people/pose2d_quality.h"

namespace mvstudio::stages {

/// A net tried on a few frames.
struct Pose2dTrial {
  std::string backend;
  PoseAgreement agreement;  ///< where it was kept from an earlier run, median_px, p90_px and share_ok alone
};

std::vector<dataset::Pose2dTrack> PoseTracks(const std::vector<CameraPoses>& cameras);

/// options.backend; "auto": the one whose keypoints agree best on frames spread over the take. The choice is kept, so that all
/// runs with the same options take the same net.
std::string ChoosePoseBackend(const Pose2dOptions& options, const DetectJob& job, const geometry::Rig& rig,
                              const RunContext& run, std::vector<Pose2dTrial>* trials);

}  // namespace mvstudio::stages
