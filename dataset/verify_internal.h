#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/panoptic.h"
#include "dataset/verify.h"

/// The two halves of VerifyDataset; not part of the module's public face.
namespace mvstudio::dataset::internal {

class Findings {
 public:
  void Error(const std::string& code, const std::string& path, const std::string& text) {
    list_.push_back({Finding::Severity::kError, code, path, text});
  }
  void Warning(const std::string& code, const std::string& path, const std::string& text) {
    list_.push_back({Finding::Severity::kWarning, code, path, text});
  }
  void Append(const Findings& other) { list_.insert(list_.end(), other.list_.begin(), other.list_.end()); }
  const std::vector<Finding>& list() const { return list_; }

 private:
  std::vector<Finding> list_;
};

/// Cameras that can be read.
geometry::Rig VerifyCalibration(const std::string& path, Findings* findings);

/// Frames that can be read.
std::map<int, Body3dScene> VerifyPoses(const std::string& root, Findings* findings);

struct PictureCounts {
  int pictures = 0, masks = 0;
};
/// Pictures and masks of one camera.
PictureCounts VerifyPictures(const std::string& root, const geometry::RigCamera& camera,
                             const std::map<int, Body3dScene>& scenes, const VerifyOptions& options, Findings* findings);

}  // namespace mvstudio::dataset::internal
