#pragma once

#include <string>

#include "core/notice.h"

namespace mvstudio::stages {

/// A run that found nothing left the result of an earlier one as it is.
inline Notice OlderKept(const std::string& path) {
  return {"CLI-OLDER-KEPT", path + ": of an earlier run, was kept, for this one found nothing", ""};
}

}  // namespace mvstudio::stages
