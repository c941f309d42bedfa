#pragma once

#include <string_view>

namespace mvstudio::report {

/// The script of the studio in 3D: report/viewer/*.js with three.js, bundled when building.
std::string_view ViewerScript();

}  // namespace mvstudio::report
