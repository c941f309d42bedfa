#pragma once

#include <memory>
#include <optional>
#include <string>

#include "cli/program/command.h"
#include "core/choice/auto_on_off.h"
#include "dataset/time/timeline.h"
#include "stages/input/pose_input.h"
#include "stages/input/session_input.h"
#include "triangulate/take/take.h"

namespace mvstudio::cli {

/// What says which frames of all cameras belong together.
struct TimingArguments {
  stages::SessionArguments session;
  std::string sync;  ///< sync.json; may be empty
  AutoOnOff calibration_offsets = AutoOnOff::kAuto;
  std::string calib;  ///< path, for messages
};

/// How the numbers of the timed frames lead back to the footage.
struct FrameNumbering {
  bool in_footage = true;  ///< they do: as they are, or by the timeline; false: frames lie between those of the footage
  std::shared_ptr<const dataset::Timeline> timeline;  ///< null: the numbers are those of the footage
};

/// Frames of all cameras that belong together: by what the take states, else by what the calibration does.
FrameNumbering ApplyTiming(const std::optional<stages::FoundTake>& found, const TimingArguments& timing,
                           const triangulate::TakeOptions& options, const RunContext& run, stages::PoseInput* input,
                           CommandResult* result);

}  // namespace mvstudio::cli
