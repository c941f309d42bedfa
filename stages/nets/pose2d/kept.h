#pragma once

#include <optional>
#include <string>

#include "stages/input/kept_footage.h"
#include "stages/nets/pose2d/detect.h"

/// What a camera gave is kept by blocks until a run that was cut is done again.
namespace mvstudio::stages {

inline constexpr char kPosesKind[] = "keypoints";

struct PoseBlock {
  CameraPoses poses;
  int64_t positions = 0;  ///< frames of the footage, looked at or not
  bool ended = false;     ///< no later block holds a frame that is wanted
};

/// The key of a camera's results, which BlockKey completes: footage, its time steps, options and net. Nothing where the net
/// cannot be told from others (PoseBackend::weights) or the footage cannot be read.
std::optional<std::string> CameraPosesKey(const DetectJob& job, const dataset::CameraFootage& footage,
                                          const PoseBackend& backend);

std::string EncodeCameraPoses(const CameraPoses& camera);
/// Throws DamagedBytes.
CameraPoses DecodeCameraPoses(const std::string& bytes);
std::string EncodePoseBlock(const PoseBlock& block);
/// Throws DamagedBytes.
PoseBlock DecodePoseBlock(const std::string& bytes);

}  // namespace mvstudio::stages
