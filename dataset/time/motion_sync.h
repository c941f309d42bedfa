#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "dataset/time/sync_file.h"
#include "dataset/time/timeline.h"

/// Coarse time offsets from images alone, without calibration or 2D poses: cameras that film the same people see motion
/// begin and end together, whatever their view. Accurate to about a frame; an initial value for `sync`, whose offsets come
/// from 2D poses.
namespace mvstudio::dataset {

/// Amount of motion in each frame of a camera, by tick of its clock.
struct MotionEnergy {
  std::string camera;
  std::vector<double> energy;  ///< [tick] mean absolute change of grey level since the previous tick; NaN: no frame
};

/// Decodes all frames. `times` are the camera's, as from ReadFootageTimes.
MotionEnergy ReadMotionEnergy(const CameraTimes& times);

struct MotionSyncOptions {
  int max_offset_frames = 180;
  int min_overlap_frames = 60;
  std::string reference;  ///< empty: the camera that agrees best with the others
};

/// Whether a camera's offset is known.
enum class MotionSyncStatus { kOk, kNoMotion, kTooShort, kAmbiguous };
std::string_view ToString(MotionSyncStatus status);  ///< "Ok", "NoMotion", "TooShort", "Ambiguous"

struct MotionSyncCamera {
  std::string name;
  MotionSyncStatus status = MotionSyncStatus::kAmbiguous;
  double offset_frames = 0;
  double sigma_frames = 0;  ///< jackknife over eighths of the take; at least 0.5
  double correlation = 0;   ///< at the offset
  double runner_up = 0;     ///< the best correlation elsewhere
};

struct MotionSync {
  std::string reference;
  std::vector<MotionSyncCamera> cameras;  ///< in the order given
};

/// Normalised correlation of log energies for every pair of cameras and every whole offset; the offsets are summed along
/// the tree of the clearest pairs. A pair is used when its peak is significant and no other peak is close. Significance:
/// Bartlett's variance of a correlation for signals this smooth, 3 sigma above the largest value expected by chance over
/// all offsets. Throws UsageError for fewer than two cameras or an unknown reference.
MotionSync SynchronizeByMotion(const std::vector<MotionEnergy>& cameras, const MotionSyncOptions& options = {});

SyncFile ToSyncFile(const MotionSync& sync);

}  // namespace mvstudio::dataset
