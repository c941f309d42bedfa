#pragma once

#include <string>
#include <vector>

#include "core/progress.h"

namespace mvstudio::dataset {

/// Something wrong with a dataset. Errors make it unusable in part, warnings ask for a look.
struct Finding {
  enum class Severity { kWarning, kError };
  Severity severity = Severity::kError;
  std::string code;  ///< DAT-CALIB, DAT-NAME, DAT-SIZE, DAT-POSE, DAT-ID, DAT-TIME, DAT-GAP, DAT-UNITS, DAT-IMAGE, DAT-MASK,
                     ///< DAT-COVER, …
  std::string path;  ///< file or folder
  std::string text;
};

struct VerifyOptions {
  int picture_step = 1;
  double least_cover = 0.8;
};

template <class Visitor>
void VisitFields(Visitor&& visit, VerifyOptions& o) {
  visit("picture-step", o.picture_step, "decode every n-th frame's pictures and masks; 1 decodes all");
  visit("least-cover", o.least_cover, "least share of a camera's joints that must lie on its masks");
}

struct VerifyReport {
  int cameras = 0, frames = 0, pictures = 0, masks = 0;  ///< pictures and masks decoded
  std::vector<Finding> findings;
  int num_errors() const;
  int num_warnings() const;
};

/// Checks a dataset folder in Panoptic layout, ours or foreign, and lists all that is wrong: calibration, names, sizes, poses,
/// missing or damaged pictures and masks, joints off the masks. Throws IoError when the folder or its calibration is not there.
VerifyReport VerifyDataset(const std::string& root, const VerifyOptions& options = {}, const RunContext& run = {});

}  // namespace mvstudio::dataset
