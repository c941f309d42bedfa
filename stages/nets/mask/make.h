#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/masks/mask_take.h"
#include "stages/nets/mask/options.h"

/// Masks of a take whose input has been read.
namespace mvstudio::stages {

/// One camera of the take, ready to be segmented.
struct MaskCamera {
  dataset::CameraFootage footage;
  std::optional<geometry::RigCamera> camera;  ///< at the footage's size; none without --calib
  dataset::FootageSamples samples;
  Image plate;                   ///< may be empty
  dataset::BodiesOfTake bodies;  ///< by frame number
  /// Time step -> frame number by the take's timeline; none: frame n shows time step n.
  std::optional<std::map<int, int>> frame_at;
  /// Frames that get a mask; none: all.
  std::optional<std::set<int>> wanted = {};
  std::string samples_key = {};  ///< of the samples, where they are kept; empty: nothing of this camera is

  /// -1: none.
  int FrameAt(int time_step) const;
  int TimeStepOf(int frame) const;
  int num_wanted() const { return wanted ? static_cast<int>(wanted->size()) : samples.num_frames; }
};

using People = std::map<int, dataset::Coco19Pose>;

struct MaskJob {
  std::vector<MaskCamera> cameras;
  std::map<int, People> poses;  ///< 3D, by time step; may be empty
  dataset::MaskOptions mask;
  dataset::HullOptions hull;
  MaskRunOptions run;
  CachePlace cache = {};  ///< of what a run that was cut has made
  bool has_calibration() const { return !cameras.empty() && cameras[0].camera.has_value(); }
};

/// A method to find people: colour and motion alone, or with a net.
struct MaskBackend {
  std::string name;
  std::shared_ptr<const detect::Segmenter> net;  ///< null: background
  std::string weights = {};                      ///< tells the net from any others; empty with a net: nothing is kept
};

/// A backend tried on a few frames.
struct MaskTrial {
  std::string name;
  Status status = Status::kOk;  ///< of the camera where it failed
  std::string failed_camera;    ///< empty when none did
  double disagreement = 0;      ///< with the visual hull; outside + missing, mean over cameras; NaN without hull
  double joints_supported = 0;  ///< fraction; NaN without joints
  std::vector<dataset::CameraMaskModel> models;
  double score() const;  ///< smaller is better
};

dataset::PersonNet NetOf(const MaskBackend& backend);

/// Learns every camera; with `on_frames` also makes masks of some frames and scores them.
MaskTrial TryBackend(const MaskJob& job, const MaskBackend& backend, bool on_frames, const RunContext& run);

struct MaskCameraResult {
  dataset::TakeMasks take;
  double background_known = 0;
  std::vector<int> frames = {};  ///< that got a mask, in order
  Image sheet;                   ///< may be empty
};

struct MaskRunResult {
  std::vector<MaskCameraResult> cameras;
  dataset::HullSummary hull;
  std::vector<size_t> disagreeing;
};

/// Keeps the masks of one camera's blocks, from `first_block` up to before `end_block`, without what other cameras exclude.
/// Writes nothing else. Returns KIND/KEY of each.
std::vector<std::string> KeepMasks(const MaskJob& job, const MaskCamera& camera, const MaskBackend& backend,
                                   const dataset::CameraMaskModel& model, int64_t first_block, int64_t end_block,
                                   const RunContext& run);

/// Writes the masks of the whole take to `folder`. Blocks of frames that were kept are not made again.
MaskRunResult MakeMasks(const MaskJob& job, const MaskBackend& backend, const std::vector<dataset::CameraMaskModel>& models,
                        const std::string& folder, const RunContext& run);

/// How far the masks in `folder` disagree with the visual hull at each time step (HullSummary::Disagreement, a part of 1); NaN
/// where there is no hull.
std::vector<double> HullDisagreements(const MaskJob& job, const std::string& folder, const std::vector<int>& steps,
                                      const RunContext& run);

/// FOLDER/CAMERA/%08d.png
std::string MaskPath(const std::string& folder, const std::string& camera, int frame);

}  // namespace mvstudio::stages
