#pragma once

#include <optional>
#include <string>
#include <vector>

#include "geometry/rig/rig_gauge.h"
#include "stages/input/corner_input.h"

/// The floor of a calibration that is made again: without option 'world' it keeps the world of the one that it replaces.
namespace mvstudio::stages {

struct EarlierWorld {
  geometry::RigGauge gauge;  ///< what fixed it
  std::string why_lost;      ///< empty: the board lies there again in frame gauge.frame, and the world stays
};

/// What fixed the world of FOLDER/calibration.json, and whether that can be had again. For that it must be a board, in the same
/// footage (by the digests in FOLDER/provenance.jsonl), paired in the same way, that is found in that frame. Nothing where
/// there is no calibration, or where its world is one camera's frame.
std::optional<EarlierWorld> FindEarlierWorld(const std::string& folder, const CornerArguments& arguments,
                                             const CornerInput& corners);

}  // namespace mvstudio::stages
