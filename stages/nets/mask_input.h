#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/footage/mask_io.h"
#include "stages/input/calib_read.h"
#include "stages/input/pose_changes.h"
#include "stages/nets/mask_run.h"

/// Reads the arguments of `mvstudio mask`.
namespace mvstudio::stages {

struct MaskArguments {
  TakeArguments take;
  std::string calib, pose3d, marker_unit, skeleton = "body25", backend = "auto", out;
  CalibReadOptions read;          ///< how the calibration is meant
  PoseChanges changes;            ///< what the 2D joints mean; its frames are the time steps that get masks
  std::vector<NamedPath> pose2d;  ///< folders
  std::vector<NamedPath> truth;   ///< folders or patterns of exact masks
  dataset::MaskOptions mask;
  dataset::HullOptions hull;
  detect::OnnxSegmenterOptions onnx;
  MaskRunOptions run;
};

/// Samples footage, checks sizes and projects joints. Throws UsageError, IoError, FormatError.
MaskJob ReadMaskJob(const MaskArguments& arguments, const TakeInput& take, CommandResult* result, const RunContext& run);

/// The backends that `--backend` names, or the available ones for "auto"; a net that is not installed is then left out
/// with a warning. Throws UsageError, MissingToolError.
std::vector<MaskBackend> MaskBackends(const MaskArguments& arguments, CommandResult* result);

/// Comparison of masks with exact ones.
struct TruthScore {
  int pictures = 0, missing = 0;
  double iou_sum = 0, worst = 1;
  std::string worst_picture;
  double too_much_px = 0, too_little_px = 0;
  dataset::MaskMeaning masks = {};  ///< of the exact ones
  bool from_one = false;            ///< they are numbered 1 to N and ours 0 to N - 1: 1 was compared with 0
};
TruthScore CompareWithTruth(const std::string& truth, const std::string& folder, const std::string& camera);

}  // namespace mvstudio::stages
