#pragma once

#include <optional>
#include <string>

#include "stages/nets/pose2d/detect.h"

/// What a camera gave is kept until a run that was cut is done again.
namespace mvstudio::stages {

/// The key of a camera's result: footage, its time steps, options and net. Nothing where the net cannot be told from others
/// (PoseBackend::weights) or the footage cannot be read.
std::optional<std::string> CameraPosesKey(const DetectJob& job, const dataset::CameraFootage& footage,
                                          const PoseBackend& backend);

std::string EncodeCameraPoses(const CameraPoses& camera);
/// Throws DamagedBytes.
CameraPoses DecodeCameraPoses(const std::string& bytes);

}  // namespace mvstudio::stages
