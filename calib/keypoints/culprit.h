#pragma once

#include <string>
#include <vector>

#include "calib/keypoints/choice.h"
#include "core/progress.h"

namespace mvstudio::calib {

/// Does one camera, or one number of it, explain what is wrong with a calibration?
struct KeypointCulprit {
  CameraFault fault = CameraFault::kNone;  ///< none: no single camera explains it
  int camera_idx = -1;
  double explained = 0;  ///< part of the cost that free poses save which this change alone saves
  double scale = 1;      ///< focal length, or image size, over that of the calibration
  double scale_sigma = 0;
  double rotation_rad = 0, rotation_sigma_rad = 0;    ///< kPose: against the calibration; sigmas along the motion
  double translation_m = 0, translation_sigma_m = 0;  ///< kPose: of the camera's centre
  geometry::RigCamera corrected;
  std::string message;  ///< one line
};

/// Frees one thing of one camera at a time, all others held as given. The best change of one number and the best change of a
/// pose, in this order, each when it saves anything over `given`; whether they are worth it, held-out frames must say
/// (ChooseKeypointPlan), and how large they are, all joints (DescribeCulprit). Pictures resized by 2.5 to 20 % are not
/// believed in. Of more than 8 cameras only the 8 whose joints fit worst are tried; of many frames so many are used, evenly
/// spread, as hold 6000 observations. `cauchy_px`: see KeypointCost.
std::vector<KeypointCulprit> FindCulprits(const geometry::Rig& given, const geometry::Rig& refined,
                                          const std::vector<KeypointJoint>& joints, double cauchy_px, const RunContext& run);

/// Fills in what was found of a culprit once the rig was adjusted with its freedom alone. Standard deviations take the rest of
/// the rig for exact.
void DescribeCulprit(const geometry::Rig& given, const geometry::Rig& adjusted, const KeypointCovariance& covariance,
                     KeypointCulprit* culprit);

}  // namespace mvstudio::calib
