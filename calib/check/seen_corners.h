#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "calib/board/observations.h"
#include "calib/rig/frame_drops.h"
#include "calib/rig/numbering.h"
#include "geometry/rig/rig.h"

/// Corners as they count: numbered from one end of the board, with one frame number a time step, at the time of the frame. What
/// is found about the input is applied to it here, once; every later step reads corners that need no more correction.
namespace mvstudio::calib {

/// Numbers the corners of these detections from another end of the board: quarter turns of each, all of the first board.
void TurnDetections(const std::vector<int>& rotated, CalibrateInput* input);

/// Corners as cameras would have seen them at the time of the frame. `late`, per camera: its capture time minus that of the
/// frame. Each corner follows the parabola through its places in the image nearest to that time and those before and after it,
/// up to two frames away, or the line through two. One that is seen in no image within a frame of that time, or in none next to
/// it, stays where it is.
CalibrateInput AtFrameTimes(CalibrateInput input, const std::vector<geometry::TimeOffset>& late);

/// The input of some of the cameras.
CalibrateInput InputOf(const CalibrateInput& input, const std::vector<int>& cameras);

/// How corners were brought to a calibration.
struct CornerFindings {
  std::vector<std::string> unknown;    ///< cameras that the calibration lacks, left out
  std::vector<RotatedCamera> rotated;  ///< cameras of which views were numbered from the board's other end
  std::vector<int64_t> frame_shift;    ///< per camera of the corners returned; empty: none
  std::vector<FrameDrop> frame_drops;  ///< frames that cameras lost
  std::string numbers_text;            ///< one line about what was done to the frame numbers; empty: nothing
};

/// A camera that the rig knows in parts, NAME and NAME@FRAME: what its frames are.
enum class CameraParts {
  kByFrame,  ///< from FRAME on, those of the later part: the recording of the calibration
  kLast,     ///< all of the last part: a later recording
};

/// Corners of the rig's cameras, corrected by what they, the rig's lenses and its poses say: parts of cameras told apart, views
/// turned, frame numbers shifted or continued after lost frames. Time offsets are not applied. Throws UsageError when the rig
/// has a camera for another image size.
CalibrateInput SeenCorners(const geometry::Rig& rig, const CalibrateInput& input, CameraParts parts, CornerFindings* findings);

/// Whether the rig knows one of the cameras in parts.
bool HasParts(const geometry::Rig& rig, const CalibrateInput& input);

/// Per camera of the input, by how much the rig states it to be late; empty where no offset matters.
std::vector<geometry::TimeOffset> StatedTimeOffsets(const geometry::Rig& rig, const CalibrateInput& input);

}  // namespace mvstudio::calib
