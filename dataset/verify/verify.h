#pragma once

#include <string>
#include <vector>

#include "core/progress.h"

namespace mvstudio::dataset {

/// Something wrong with a dataset. Errors make it unusable in part, warnings ask for a look.
struct Finding {
  enum class Severity { kWarning, kError };
  Severity severity = Severity::kError;
  std::string code;  ///< DAT-CALIB, DAT-POSE, …: the table in docs/formats.md
  std::string path;  ///< file or folder
  std::string text;
};

struct VerifyOptions {
  int picture_step = 1;
  double least_cover = 0.8;
  bool follow_links = false;
};

template <class Visitor>
void VisitFields(Visitor&& visit, VerifyOptions& o) {
  visit("picture-step", o.picture_step, "decode every n-th frame's pictures and masks; 1 decodes all");
  visit("least-cover", o.least_cover, "least share of a camera's joints that must lie on its masks");
  visit("follow-links", o.follow_links, "read through symbolic links that lead out of the folder; off lists them as errors");
}

struct VerifyReport {
  int cameras = 0;                          ///< calibrated and with footage, all panels
  int frames = 0;                           ///< body3DScene files that can be read
  int pictures = 0, masks = 0, videos = 0;  ///< decoded
  int faces = 0, hands = 0;                 ///< files that can be read
  std::string unusable;  ///< why nothing can be made of the folder: no camera, or neither joints nor pictures; else empty
  std::vector<Finding> findings;
  int num_errors() const;
  int num_warnings() const;
};

/// Checks a dataset folder in Panoptic layout, ours or foreign, and lists all that is wrong: calibration, names, sizes, joints,
/// faces, hands, sync tables, missing, damaged or doubled pictures and videos, masks, joints off the masks. Throws IoError when
/// the folder or its calibration is not there.
VerifyReport VerifyDataset(const std::string& root, const VerifyOptions& options = {}, const RunContext& run = {});

}  // namespace mvstudio::dataset
