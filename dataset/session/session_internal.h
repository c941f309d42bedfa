#pragma once

#include <string>
#include <vector>

#include "dataset/session/session.h"

/// Internal to the module.
namespace mvstudio::dataset::internal {

/// The footage in raw/TAKE/CAMERA.* and raw/plate/CAMERA.*, for the session's cameras that have any. Throws FormatError when a
/// camera has two.
std::vector<SessionFootage> ScanFootage(const Session& session, const std::string& take);

}  // namespace mvstudio::dataset::internal
