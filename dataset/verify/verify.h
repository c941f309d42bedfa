#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"

namespace mvstudio::dataset {

/// A defect of a dataset. Errors make it partly unusable; warnings should be inspected.
struct Finding {
  enum class Severity { kWarning, kError };
  Severity severity = Severity::kError;
  std::string code;  ///< DAT-CALIB, DAT-POSE, …: the table in docs/formats.md
  std::string path;  ///< file or folder
  std::string text;
};

struct VerifyOptions {
  int image_step = 1;
  double least_cover = 0.8;
  bool follow_links = false;
};

template <class Visitor>
void VisitFields(Visitor&& visit, VerifyOptions& o) {
  visit("picture-step", o.image_step, "decode every n-th frame's images and masks; 1 decodes all");
  visit("least-cover", o.least_cover, "least share of a camera's joints that must lie on its masks");
  visit("follow-links", o.follow_links, "read through symbolic links that lead out of the folder; off lists them as errors");
}

struct VerifyReport {
  int cameras = 0;                        ///< calibrated and with footage, all panels
  int frames = 0;                         ///< body3DScene files that are readable
  int images = 0, masks = 0, videos = 0;  ///< decoded
  int faces = 0, hands = 0;               ///< files that are readable
  std::string skeleton;                   ///< of the joints beside Panoptic's 19; empty: there are none
  int own_frames = 0;                     ///< files of it that are readable
  std::map<std::string, int> no_image;    ///< by camera, where not 0: frames with joints without an image
  std::map<std::string, int> no_mask;     ///< likewise with an image and without a mask, in datasets with masks
  std::string unusable;                   ///< why the folder is unusable: no camera, or neither joints nor images; else empty
  std::vector<Finding> findings;
  int num_errors() const;
  int num_warnings() const;
};

/// Checks of single cameras that several processes share.
struct KeptChecks {
  std::function<std::optional<std::string>(const std::string& camera)> load = {};
  std::function<void(const std::string& camera, std::string bytes)> store = {};
  int index = 0, count = 0;  ///< only the cameras whose number in the calibration, modulo `count`, is `index`; 0: all
};

/// Checks a dataset folder in Panoptic layout, from mvstudio or elsewhere, and lists all defects. Checked are calibration,
/// names, sizes, joints, faces, hands, sync tables, missing, damaged or repeated images and videos, masks, and joints
/// off the masks. Images and masks that are missing are a warning, for a camera without any an error. Throws IoError when the
/// folder or its calibration is missing.
/// `kept.load`: what is there is not looked at again. With `kept.count`, cameras are not compared with each other, and the
/// report is of those cameras alone.
VerifyReport VerifyDataset(const std::string& root, const VerifyOptions& options = {}, const RunContext& run = {},
                           const KeptChecks& kept = {});

}  // namespace mvstudio::dataset
