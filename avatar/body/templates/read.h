#pragma once

#include <string>

#include "avatar/body/body_template.h"

namespace mvstudio::body {

/// "mannequin" (or nothing), a folder of MakeHuman's base mesh, rigs and targets, or a .npz or .pkl file in SMPL's layout.
/// Throws IoError, FormatError with the place.
BodyTemplate ReadTemplate(const std::string& source);

}  // namespace mvstudio::body
