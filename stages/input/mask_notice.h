#pragma once

#include <string>

#include "dataset/footage/mask_io.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// Says how a set of masks was read, where that is not plain: a line and `masks_read_as`; a warning where it is doubtful.
inline void TellMasks(const dataset::MaskMeaning& meaning, const std::string& where, CommandResult* result) {
  const std::string text = meaning.Text();
  if (text.empty()) return;
  result->metrics["masks_read_as"] = text;
  if (meaning.IsDoubtful()) {
    result->warnings.push_back(
        {"DAT-MASK-VALUES", where + ": " + text, "look at them; 255 must be the person and 0 the background"});
  } else {
    const bool in_line = !result->text.empty() && result->text.back() != '\n';
    result->text += (in_line ? "\n  " : "  ") + text + (in_line ? "" : "\n");
  }
}

}  // namespace mvstudio::stages
