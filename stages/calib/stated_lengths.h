#pragma once

#include <string>
#include <vector>

#include "calib/points/stated_length.h"
#include "stages/result.h"

/// Option 'length' of the commands that give a rig its size.
namespace mvstudio::stages {

inline constexpr char kLengthHelp[] =
    "POINT:POINT:LENGTH, e.g. LShoulder:RShoulder:380mm, or Height:1.75m; :2mm at its end is its standard deviation; gives the "
    "rig its size; repeatable";

/// Metrics `scale`, `scale_sigma`, `lengths`, lines of text, and warnings for lengths that disagree and for units that are
/// unlikely. A status that is not kOk becomes an error, and exit 5.
CommandResult DescribeLengths(const calib::LengthScale& scale);

}  // namespace mvstudio::stages
