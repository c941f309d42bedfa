#pragma once

#include <string>
#include <vector>

#include "calib/detect/detect_footage.h"
#include "stages/input_notes.h"
#include "stages/words.h"

namespace mvstudio::stages {

/// Opens the footage of the cameras. Frames of an image camera are numbered by their file names, those of a video by
/// position. Images of another size than most of a camera's, and of several cameras those without a number, are left out and
/// named. Adds the paths to notes->inputs. Throws UsageError without cameras or for
/// one given twice.
std::vector<calib::Footage> OpenFootage(const std::vector<NamedPath>& cameras, InputNotes* notes);

}  // namespace mvstudio::stages
