#pragma once

#include <string>

#include "avatar/body/files/textured_person.h"

namespace mvstudio::stages {

inline constexpr char kBodyMotionFile[] = "body_motion.bin", kBodyTextureFile[] = "body_texture.bin";

/// The skinned body and its bones in the frames that it was posed in, for the report's studio in 3D: docs/formats.md. At most
/// 4 MB; frames are then thinned evenly. Empty without a pose, and for bodies of more than 255 bones.
std::string BodyMotion(const body::PersonBody& person);

/// The colours of that body: docs/formats.md. Its image is a JPEG of at most 1024 px and 256 kB. Empty without textures.
std::string BodyTexture(const body::TexturedPerson& person);

}  // namespace mvstudio::stages
