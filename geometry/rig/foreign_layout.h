#pragma once

#include <string>
#include <string_view>

namespace mvstudio::geometry {

/// The layout that a calibration's file has, of programs and datasets whose files are known by their keys or first bytes and
/// are not read here: "Human3.6M's camera-parameters.json". Empty for others.
std::string ForeignLayout(std::string_view text);

/// Whether an XML text is Metashape's project or export of cameras.
bool IsMetashape(std::string_view text);

/// Whether a JSON text has a list `cameras`, as Panoptic's calibrations have.
bool LooksLikePanoptic(std::string_view json);

}  // namespace mvstudio::geometry
