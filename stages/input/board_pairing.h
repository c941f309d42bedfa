#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "calib/detect/detect_footage.h"
#include "dataset/time/timeline.h"
#include "stages/input_notes.h"

/// Which images of a board in several cameras belong together: those of one time step where a timeline is known, else those
/// with the same number.
namespace mvstudio::stages {

/// Numbers the cameras' frames by the timeline's time steps. A camera that has no place in it keeps its numbers, with a
/// warning.
void PairByTime(const dataset::Timeline& timeline, std::vector<calib::Footage>* footage, InputNotes* notes);

/// {"by": "number"}, or {"by": "time", "clock", "reference", "dropped": frames that cameras lost}. `timeline` may be null.
nlohmann::ordered_json PairingJson(const dataset::Timeline* timeline);
/// One line.
std::string PairingText(const dataset::Timeline* timeline);

}  // namespace mvstudio::stages
