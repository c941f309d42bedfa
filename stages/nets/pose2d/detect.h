#pragma once

#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/disk/kept.h"
#include "core/progress.h"
#include "dataset/detect/joints/joint_net.h"
#include "dataset/detect/joints/pose_tracker.h"
#include "dataset/pose/pose2d.h"
#include "stages/input/take_input.h"
#include "stages/input_notes.h"

/// Keypoints of a take's footage.
namespace mvstudio::stages {

/// A detector of joints.
struct PoseBackend {
  std::string name;  ///< "posenet", "movenet", "blazepose" or "onnx:FILE"
  std::shared_ptr<const detect::JointNet> net;
  std::shared_ptr<const detect::PersonFinder> finder;  ///< may be null: the person fills the image
  detect::CropPlan plan;
  std::string weights = {};  ///< tells the net and the finder from any others; empty: unknown, and nothing is kept
};

/// Throws UsageError for an unknown name, and what the nets' functions throw.
PoseBackend OpenPoseBackend(const std::string& name, const std::string& models, detect::PoseQuality quality,
                            const detect::OnnxOptions& onnx);

/// Names of the installed nets, the preferred one (without a measurement) first. Throws MissingToolError when there is
/// none.
std::vector<std::string> InstalledPoseBackends(const std::string& models);

struct CameraPoses {
  dataset::Pose2dTrack track;
  std::map<int, Image> overlays;    ///< a few frames with the keypoints drawn
  std::vector<std::string> damage;  ///< of the footage, one line each
  std::string failure;              ///< why there is no result; empty: success
  int frames = 0, frames_with_people = 0;
  std::vector<int> numbers = {};  ///< with DetectJob::frames: those of the footage, up to the last that was asked for
  int width = 0, height = 0;
  double seconds = 0;  ///< of detection, without decoding
  double read_s = 0;   ///< of decoding the frames that were looked at
};

struct DetectJob {
  std::vector<dataset::CameraFootage> footage;
  detect::PoseOptions options;
  int overlays = 0;              ///< frames to draw per camera
  int every = 1;                 ///< use every n-th frame
  int max_frames = 0;            ///< 0: all
  std::vector<int> frames = {};  ///< sorted numbers, as poses are numbered; empty: all
  CachePlace cache = {};         ///< of what cameras gave before
  int first = 0;                 ///< frames of the footage that are passed over, in trials, of which nothing is kept
  /// Blocks of kKeptBlock frames of the footage that are looked at, up to before the last.
  int64_t first_block = 0, end_block = std::numeric_limits<int64_t>::max();
};

/// Runs the cameras in parallel. Frames have the number of the time step where the footage has a timeline, else their own.
/// A camera with unreadable footage has a failure; the others continue. What a block of a camera gave is kept as soon as it is
/// there, so that a run that was cut goes on with the next; people are looked for anew at the begin of each block.
std::vector<CameraPoses> DetectPoses(const DetectJob& job, const PoseBackend& backend, const RunContext& run);

}  // namespace mvstudio::stages
