#pragma once

#include <cstdint>
#include <vector>

#include "calib/calibrate.h"

/// A rig adjusted again with one camera as two.
namespace mvstudio::calib {

/// Starts from `solved`, lens models as there, time offsets where it has them: `input` with the corners as they were seen. The
/// last camera of the report is the later part, NAME@FRAME.
CalibrateReport AdjustSplit(const CalibrateInput& input, const CalibrateReport& solved, CalibrateOptions options,
                            const CameraSplit& split, const RunContext& run);

/// Squared errors of all corners of such a report, relative to those of the cameras by themselves in `solved`, each at most 36;
/// infinite without a solution. `camera` is the index of the split one.
double CappedSquares(const CalibrateReport& report, const CalibrateReport& solved, size_t camera);

/// Frames in which a camera sees a board, ascending.
std::vector<int64_t> FramesWithBoards(const CalibrateInput& input, int camera);

}  // namespace mvstudio::calib
