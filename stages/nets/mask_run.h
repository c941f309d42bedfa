#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/detect/segment/segment.h"
#include "dataset/masks/mask_take.h"
#include "dataset/masks/size_rule.h"
#include "dataset/masks/visual_hull.h"
#include "stages/input/take_input.h"
#include "stages/result.h"

/// The work of `mvstudio mask`, without parsing and printing.
namespace mvstudio::stages {

struct MaskRunOptions {
  int hull_frames = 24;
  int trial_frames = 6;
  int sheet_tiles = 24;
  bool soft = false;
  bool hull = false;
  bool keep_undamaged = false;
  bool overwrite = false;
  dataset::SizeRuleChoice size_rule = dataset::SizeRuleChoice::kAuto;
};

template <class Visitor>
void VisitFields(Visitor&& visit, MaskRunOptions& o) {
  visit("soft", o.soft, "write the covered share of each pixel, too: OUT/soft/CAMERA/%08d.png, 0..255");
  visit(
      "hull", o.hull,
      "make the masks twice, the second time without pixels that the masks of two other cameras exclude; needs option 'calib'");
  visit("hull-frames", o.hull_frames, "frames on which masks are compared with the visual hull; 0: none");
  visit("trial-frames", o.trial_frames, "frames on which option 'backend' auto tries every backend");
  visit("sheet-tiles", o.sheet_tiles, "images on each camera's contact sheet; 0: no sheet");
  visit("size-rule", o.size_rule,
        "footage of another size than calibrated: auto, fill, stretch, crop-right, crop-centre or crop-left");
  visit("keep-undamaged", o.keep_undamaged, "use what decodes of damaged footage and list what is missing");
  visit("overwrite", o.overwrite, "replace the output folder");
}

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

  /// -1: none.
  int FrameAt(int instant) const;
  int InstantOf(int frame) const;
  int num_wanted() const { return wanted ? static_cast<int>(wanted->size()) : samples.num_frames; }
};

using People = std::map<int, dataset::Coco19Pose>;

struct MaskJob {
  std::vector<MaskCamera> cameras;
  std::map<int, People> poses;  ///< 3D, by time step; may be empty
  dataset::MaskOptions mask;
  dataset::HullOptions hull;
  MaskRunOptions run;
  bool has_calibration() const { return !cameras.empty() && cameras[0].camera.has_value(); }
};

/// A method to find people: colour and motion alone, or with a net.
struct MaskBackend {
  std::string name;
  std::shared_ptr<const detect::Segmenter> net;  ///< null: background
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
  Image sheet;  ///< may be empty
};

struct MaskRunResult {
  std::vector<MaskCameraResult> cameras;
  dataset::HullSummary hull;
  std::vector<size_t> disagreeing;
};

/// Writes the masks of the whole take to `folder`.
MaskRunResult RunMasks(const MaskJob& job, const MaskBackend& backend, const std::vector<dataset::CameraMaskModel>& models,
                       const std::string& folder, const RunContext& run);

/// FOLDER/CAMERA/%08d.png
std::string MaskPath(const std::string& folder, const std::string& camera, int frame);

}  // namespace mvstudio::stages
