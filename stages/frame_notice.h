#pragma once

#include <string>

#include "stages/input_notes.h"

namespace mvstudio::stages {

/// Says which frames were asked for that are not there: `beyond` of a FrameChoice.
inline void NoteFrames(const std::string& beyond, InputNotes* notes) {
  if (!beyond.empty())
    notes->warnings.push_back({"CLI-FRAMES", beyond, "look at the numbers: files count from 0 or as they are named"});
}

}  // namespace mvstudio::stages
