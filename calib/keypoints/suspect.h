#pragma once

#include <string>
#include <vector>

#include "calib/keypoints/choice.h"
#include "core/progress.h"

namespace mvstudio::calib {

/// A single camera, or a single parameter of it, as the explanation of a wrong calibration.
struct KeypointSuspect {
  CameraFault fault = CameraFault::kNone;  ///< none: no single camera explains it
  int camera_idx = -1;
  double explained = 0;  ///< part of the cost reduction by free poses that this change alone achieves
  double scale = 1;      ///< focal length, or image size, over that of the calibration
  double scale_sigma = 0;
  double rotation_rad = 0, rotation_sigma_rad = 0;    ///< kPose: against the calibration; sigmas along the motion
  double translation_m = 0, translation_sigma_m = 0;  ///< kPose: of the camera's centre
  geometry::RigCamera corrected;
  std::string message;  ///< one line
};

/// Frees one parameter or pose of one camera at a time, with all others as given. Returns the best change of one parameter
/// and the best change of a pose, in this order, each if it lowers the cost of `given`. Held-out frames decide whether a
/// change is worthwhile (ChooseKeypointPlan), and all joints determine its size (DescribeSuspect).
///
/// Of two cameras none: either could be the wrong one, and with one held the size of the other's motion is not determined.
///
/// Images resized by 2.5 to 20 % are not accepted. Of more than 8 cameras, only the 8 whose joints fit worst are tried.
/// Frames are thinned evenly to about 6000 observations. `cauchy_px`: see KeypointCost.
std::vector<KeypointSuspect> FindSuspects(const geometry::Rig& given, const geometry::Rig& refined,
                                          const std::vector<KeypointJoint>& joints, double cauchy_px, const RunContext& run);

/// Fills in the size of a suspect's change after the rig was adjusted with its freedom alone. Standard deviations treat
/// the rest of the rig as exact.
void DescribeSuspect(const geometry::Rig& given, const geometry::Rig& adjusted, const KeypointCovariance& covariance,
                     KeypointSuspect* suspect);

}  // namespace mvstudio::calib
