#pragma once

#include <string>
#include <vector>

#include "core/notice.h"

namespace mvstudio::stages {

/// What reading brought beside its values.
struct InputNotes {
  std::vector<Notice> warnings;
  std::vector<std::string> inputs;  ///< files and folders read, for provenance
  bool partial = false;             ///< cameras, files or frames were left out, and are listed
};

}  // namespace mvstudio::stages
