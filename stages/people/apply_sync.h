#pragma once

#include <string>

#include "stages/input/pose_input.h"

namespace mvstudio::stages {

/// The detections as the reference camera of a sync file would have numbered their frames. Cameras without an offset are left
/// out, with a warning.
void ApplySync(const std::string& path, PoseInput* input, InputNotes* notes);

}  // namespace mvstudio::stages
