#pragma once

#include <string>

#include "dataset/footage/mask_io.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// How a set of masks was read, where that is not plain: a line and `masks_read_as`; a warning where it is ambiguous. `before`:
/// the text that the line follows.
inline CommandResult DescribeMaskMeaning(const dataset::MaskMeaning& meaning, const std::string& where,
                                         const std::string& before) {
  CommandResult result;
  const std::string text = meaning.Text();
  if (text.empty()) return result;
  result.metrics["masks_read_as"] = text;
  if (meaning.IsDoubtful()) {
    result.warnings.push_back(
        {"DAT-MASK-VALUES", where + ": " + text, "look at them; 255 must be the person and 0 the background"});
  } else {
    const bool in_line = !before.empty() && before.back() != '\n';
    result.text = (in_line ? "\n  " : "  ") + text + (in_line ? "" : "\n");
  }
  return result;
}

}  // namespace mvstudio::stages
