#pragma once

#include <string>
#include <vector>

#include "core/notice.h"

namespace mvstudio::stages {

/// What `mask` said of the doubtful masks in this folder: they follow the joints, so that no later check of the two would
/// notice. Empty where no result of it is there, or none that can be read.
std::vector<Notice> MaskWarnings(const std::string& masks);

}  // namespace mvstudio::stages
