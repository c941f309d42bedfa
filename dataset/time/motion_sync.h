#pragma once

#include <string>
#include <vector>

#include "dataset/time/sync_file.h"
#include "dataset/time/timeline.h"

/// Coarse time offsets from pictures alone, without calibration or 2D poses: cameras that film the same people see movement
/// begin and end together, whatever their view. Good to a frame or so; a start for `sync`, whose offsets come from 2D poses.
namespace mvstudio::dataset {

/// How much moved in each frame of a camera, by tick of its clock.
struct MotionEnergy {
  std::string camera;
  std::vector<double> energy;  ///< [tick] mean absolute change of grey level since the tick before; NaN: no frame
};

/// Decodes all. `times` are the camera's, as ReadFootageTimes gives them.
MotionEnergy ReadMotionEnergy(const CameraTimes& times);

struct MotionSyncOptions {
  int max_offset_frames = 180;
  int min_overlap_frames = 60;
  std::string reference;  ///< empty: the camera that agrees best with the others
};

struct MotionSyncCamera {
  std::string name;
  std::string status;  ///< "Ok", "NoMotion", "TooShort", "Ambiguous"
  double offset_frames = 0;
  double sigma_frames = 0;  ///< from leaving out each eighth of the take in turn; at least 0.5
  double correlation = 0;   ///< at the offset
  double runner_up = 0;     ///< the best correlation elsewhere
};

struct MotionSync {
  std::string reference;
  std::vector<MotionSyncCamera> cameras;  ///< in the order given
};

/// Normalised correlation of log energies for every pair of cameras and every whole offset; the offsets are summed along the
/// tree of the clearest pairs. A pair counts when its peak stands out of what chance makes of signals as smooth as these
/// (Bartlett's variance of a correlation, 3 sigma above the largest expected of so many offsets) and no other peak comes near.
/// Throws UsageError for fewer than two cameras or an unknown reference.
MotionSync SynchronizeByMotion(const std::vector<MotionEnergy>& cameras, const MotionSyncOptions& options = {});

SyncFile ToSyncFile(const MotionSync& sync);

}  // namespace mvstudio::dataset
