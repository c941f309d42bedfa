#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/choice/auto_on_off.h"
#include "core/progress.h"
#include "geometry/rig/rig.h"
#include "stages/input/pose_input.h"
#include "stages/result.h"
#include "triangulate/take/take.h"

/// Reports, in text, metrics and warnings, how a command uses the uncertainty and the time offsets that a calibration
/// states.
namespace mvstudio::stages {

/// One line: whether the sigmas of a result include the calibration's own uncertainty, and for which cameras it is
/// unknown. `cameras`: names of those used; empty: all of the rig. `unused_because`: empty when the command uses what is
/// stated.
std::string CovarianceUse(const geometry::Rig& rig, const std::vector<std::string>& cameras, const std::string& unused_because);

/// Same as metrics["calibration_covariance"] (used, reason, known, missing, correlated, assumed) and as a line of text, with
/// the warning CAL-COVARIANCE-MISSING when some of `cameras` have a covariance and others do not.
CommandResult DescribeCovarianceUse(const geometry::Rig& rig, const std::vector<std::string>& cameras,
                                    const std::string& unused_because);

/// For a rig that a command wrote: metrics["covariance_missing"], a warning for cameras whose covariance is unknown, and a
/// warning when the joint covariance is too large for the file. `also`: more cameras whose errors were unknown to the
/// command.
CommandResult DescribeWrittenCovariance(const geometry::Rig& rig, const std::vector<std::string>& also = {});

/// Time offsets of the calibration in the rig's order, 0 where a camera has none; empty when no camera has a relevant one.
std::vector<double> OffsetsOfCalibration(const geometry::Rig& rig);

/// Whether time offsets that a calibration states were applied, and why.
struct OffsetUse {
  bool applied = false;
  std::string reason;
  std::vector<double> frames = {};  ///< in the rig's order, where they were applied
};

/// metrics["calibration_offsets"].
nlohmann::ordered_json OffsetUseJson(const OffsetUse& use);

/// The calibration's offsets are not applied, for this reason; nothing without offsets.
std::optional<OffsetUse> OffsetsUnused(const geometry::Rig& rig, const std::string& why);

/// Applies the calibration's offsets to the detections: with kAuto when the take confirms them.
std::optional<OffsetUse> ApplyCalibrationOffsets(AutoOnOff how, const triangulate::TakeOptions& options, const RunContext& run,
                                                 PoseInput* input, InputNotes* notes);

}  // namespace mvstudio::stages
