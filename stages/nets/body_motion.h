#pragma once

#include <string>

#include "avatar/body/fit/person_body.h"

namespace mvstudio::stages {

inline constexpr char kBodyMotionFile[] = "body_motion.bin";

/// The body's mesh in at most 120 of the frames that it was posed in, evenly spread, for the report's studio in 3D: a file of
/// Gaussians in motion without Gaussians (docs/formats.md, `player.bin`), of 4 MB at most. Empty without a pose.
std::string BodyMotion(const body::PersonBody& person);

}  // namespace mvstudio::stages
