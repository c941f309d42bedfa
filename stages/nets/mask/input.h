#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/footage/mask_io.h"
#include "stages/nets/mask/make.h"

/// Reads what masks are made of.
namespace mvstudio::stages {

/// Samples footage, checks sizes and projects joints. Throws UsageError, IoError, FormatError.
MaskJob ReadMaskJob(const MaskStageOptions& options, const TakeInput& take, InputNotes* notes, const RunContext& run);

/// The backends that `--backend` names, or the available ones for "auto"; a net that is not installed is then left out
/// with a warning. Throws UsageError, MissingToolError.
std::vector<MaskBackend> MaskBackends(const MaskStageOptions& options, InputNotes* notes);

/// Comparison of masks with exact ones.
struct TruthScore {
  int images = 0, missing = 0;
  double iou_sum = 0, worst = 1;
  std::string worst_image;
  double too_much_px = 0, too_little_px = 0;
  dataset::MaskMeaning masks = {};  ///< of the exact ones
  bool from_one = false;            ///< they are numbered 1 to N and ours 0 to N - 1: 1 was compared with 0
};
TruthScore CompareWithTruth(const std::string& truth, const std::string& folder, const std::string& camera);

}  // namespace mvstudio::stages
