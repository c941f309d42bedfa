#pragma once

#include <string>

#include "avatar/body/fit/person_body.h"

namespace mvstudio::stages {

inline constexpr char kBodyMotionFile[] = "body_motion.bin";

/// The skinned body and its bones in the frames that it was posed in, for the report's studio in 3D: docs/formats.md. At most
/// 4 MB; frames are then thinned evenly. Empty without a pose, and for bodies of more than 255 bones.
std::string BodyMotion(const body::PersonBody& person);

}  // namespace mvstudio::stages
