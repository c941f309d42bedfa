#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/calibrate_options.h"
#include "cli/program/command.h"
#include "geometry/rig/rig_gauge.h"
#include "stages/input/corner_input.h"

/// The floor of a calibration that is made again: `calibrate` without --world keeps the world of the one that it replaces.
namespace mvstudio::cli {

/// What fixed the world of FOLDER/calibration.json. Nothing where there is none, or where it is one camera's frame.
std::optional<geometry::RigGauge> EarlierGauge(const std::string& folder);

/// Sets `world` to the board that fixed the world before, and says so, where that board lies there again: the same footage
/// (by the digests in FOLDER/provenance.jsonl), paired in the same way, with a board in that frame. Otherwise says that the
/// world is lost, why, and how to have it back (CAL-WORLD). `earlier` is that of EarlierGauge, `pairing` as stages::PairingJson
/// says.
void KeepEarlierWorld(const std::string& folder, const std::optional<geometry::RigGauge>& earlier,
                      const std::vector<std::string>& footage, const stages::CornerInput& corners, const std::string& pairing,
                      calib::WorldOrigin* world, CommandResult* result);

}  // namespace mvstudio::cli
