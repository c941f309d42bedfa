#pragma once

#include <array>
#include <optional>
#include <string>

#include "avatar/body/body_template.h"
#include "core/image.h"

namespace mvstudio::synth {

/// A body from a file, and its colours where the file has them.
struct GivenBody {
  body::BodyTemplate body;
  std::optional<std::array<Image, body::kNumParts>> textures;
};

/// A body.npz of a fit (docs/formats.md), MakeHuman's folder, or a .npz or .pkl file in SMPL's layout. Throws IoError and
/// FormatError as their readers do; FormatError where a body.npz lacks a bone that poses need.
GivenBody ReadBody(const std::string& path);

}  // namespace mvstudio::synth
