#pragma once

#include <string_view>

namespace mvstudio::report {

/// Whether bytes begin as a file of a body in motion does, and have its length (`body_motion.bin`, docs/formats.md).
bool IsBodyFile(std::string_view bytes);

/// The same of a body's colours (`body_texture.bin`), with a JPEG or PNG in it.
bool IsBodyTexture(std::string_view bytes);

}  // namespace mvstudio::report
