#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "core/choice/option_group.h"
#include "core/notice.h"
#include "core/progress.h"
#include "dataset/footage/mask_io.h"
#include "dataset/masks/masks.h"
#include "dataset/masks/size_rule.h"
#include "dataset/time/timeline.h"
#include "geometry/rig/rig.h"

namespace mvstudio::dataset {

/// Footage of one camera.
struct CameraFootage {
  std::string camera;                                  ///< name in the calibration
  std::string path;                                    ///< video, image folder or pattern
  std::string plate;                                   ///< clean plate: image of the empty scene; may be empty
  std::shared_ptr<const Timeline> timeline = nullptr;  ///< which frame shows which time step; none: frame n shows time step n
};

struct BuildInputs {
  std::string calibration;  ///< ours or Panoptic's
  std::vector<CameraFootage> footage;
  std::string pose3d;            ///< folder with points.csv, a dataset or folder of body3DScene files, or a .trc or .c3d file
  std::string marker_unit = {};  ///< m, cm, mm or in, instead of what such a file states
  std::string masks = {};        ///< folder with a folder of masks for each camera, instead of making them; may be empty
  std::string skeleton = {};     ///< name or file of the joints' skeleton, instead of what `pose3d` states; may be empty
  std::vector<int> frames = {};  ///< time steps of the joints that are built, sorted; empty: all
  int first_frame = 0;           ///< number of the joints for the footage's first frame
  int first_mask = 0;            ///< the same of `masks`
  /// Folder where blocks of frames are kept under `kept_key` as soon as they are made: what is there is not made again. All of
  /// the key is removed when the dataset is there, or cannot be built; with it, in a hidden folder, that of other keys. Empty:
  /// nothing is kept.
  std::string kept = {};
  std::function<std::string()> kept_key = {};  ///< of everything that the images and masks are made of
};

struct BuildOptions {
  std::string sequence = "take";
  bool masks = true;
  bool png = false;
  int jpeg_quality = 95;
  double frame_rate_hz = 30;
  SizeRuleChoice size_rule = SizeRuleChoice::kAuto;
  bool require_complete = false;
  bool keep_undamaged = false;
  bool overwrite = false;
  MaskOptions mask;
};

template <class Visitor>
void VisitFields(Visitor&& visit, BuildOptions& o) {
  visit("sequence", o.sequence, "name of the sequence, as in calibration_<sequence>.json");
  visit("png", o.png, "keep images without loss instead of as JPEG");
  visit("jpeg-quality", o.jpeg_quality, "0..100");
  visit("frame-rate", o.frame_rate_hz, "Hz; frame rate of image folders; videos state their own");
  visit("size-rule", o.size_rule,
        "footage of another size than calibrated: auto, fill, stretch, crop-right, crop-centre or crop-left");
  visit("require-complete", o.require_complete,
        "refuse a take in which a camera has no frame for a time step with joints, instead of leaving the image out");
  visit("keep-undamaged", o.keep_undamaged, "use what decodes of damaged footage and list what is missing");
  visit("overwrite", o.overwrite, "replace the output folder");
  StartGroup(visit, "Masks");
  VisitFields(visit, o.mask);
}

struct BuiltCamera {
  std::string name;   ///< Panoptic's, 00_NN
  std::string alias;  ///< the studio's
  int images = 0;
  std::string size_rule;
  double background_known = 0;  ///< fraction of the image whose background was seen
  double mean_area_fraction = 0;
  int joints = 0, joints_on_mask = 0, joints_supported = 0;
  std::vector<int> without_mask = {};  ///< time steps with an image, for which no mask was given
};

/// Time steps with joints for which a camera has no image.
struct BuildGaps {
  std::string camera;  ///< the studio's name
  std::vector<int> time_steps;
};

struct BuildReport {
  std::string sequence;
  int frames = 0;
  int images = 0;
  std::vector<BuiltCamera> cameras;
  std::vector<BuildGaps> gaps;  ///< cameras with gaps; if there are any, the dataset is partial
  std::vector<Notice> warnings;
  int given_masks = 0;                           ///< that were taken from BuildInputs::masks
  MaskMeaning masks = {};                        ///< how those were read
  std::string skeleton;                          ///< of the joints that are written beside Panoptic's 19; empty: none are
  std::vector<std::string> joints_beside;        ///< joints with points that give none of the 19
  std::string marker_unit = {}, marker_up = {};  ///< of a .trc or .c3d file: its unit of length, and "y" or "z"; else empty
  std::string world = {};                        ///< of the 3D joints: its axes, in words
  double calibration_offset_frames = 0;  ///< largest time offset that the calibration states for a camera without a timeline;
                                         ///< not applied
};

/// Footage + calibration + 3D joints -> folder `out` in Panoptic layout (docs/formats.md). Frame n of a video (or the
/// number in an image's name) is frame n of the 3D joints, unless the footage has a timeline. Then the 3D joints' frames
/// are its time steps, and each camera gives the frame that shows the time step, or none (listed in `gaps`).
///
/// The folder appears complete or not at all. The calibration's time offsets are not applied: a dataset holds whole
/// images. Joints that give none of Panoptic's 19 are written beside them, with all others of their skeleton
/// (dataset/panoptic/own_joints.h). Throws FormatError naming camera and frame for damaged footage, cameras that are not in the
/// calibration, sizes that cannot be explained, and gaps with `require_complete`.
BuildReport BuildDataset(const BuildInputs& inputs, const std::string& out, const BuildOptions& options,
                         const RunContext& run = {});

/// What one process keeps for a build that another does.
struct BuildPart {
  std::string camera;    ///< the studio's name
  bool samples = false;  ///< what is learned from a first pass over the footage, in place of blocks
  int64_t first_block = 0, end_block = std::numeric_limits<int64_t>::max();  ///< of 300 frames, up to before the last
};

/// Makes the part under `inputs.kept` and `inputs.kept_key`, where BuildDataset with the same inputs and options finds it.
/// Returns what is there then, as KEY/CAMERA-BLOCK. Throws as BuildDataset does, and UsageError for a camera without footage.
std::vector<std::string> KeepBuildPart(const BuildInputs& inputs, const BuildPart& part, const BuildOptions& options,
                                       const RunContext& run = {});

}  // namespace mvstudio::dataset
