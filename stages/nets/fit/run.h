#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/footage/mask_io.h"
#include "stages/nets/body_folder.h"
#include "stages/nets/fit/options.h"

namespace mvstudio::stages {

struct AvatarFitReport {
  InputNotes notes;
  std::string dataset, folder;
  avatar::PersonFit fit;
  std::optional<SurfaceLimits> surface;  ///< of surface.png, where it was written
  std::vector<Notice> conflicts;         ///< CheckTrainingImages
  dataset::MaskMeaning masks;
};

/// Fits a body to the training images of a split and writes its folder. Throws UsageError, IoError and FormatError; a body that
/// lies beside its masks is no error (JudgeFit).
AvatarFitReport RunAvatarFit(const AvatarFitOptions& options, const RunContext& run = {});

}  // namespace mvstudio::stages
