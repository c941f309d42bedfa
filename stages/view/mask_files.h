#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "core/image.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/mask_io.h"

namespace mvstudio::stages {

/// Paths by the number in their names.
using FilesByNumber = std::map<int64_t, std::string>;
FilesByNumber NumberedFiles(const dataset::FootageFiles& found);

/// One camera's masks by the number in their names, and what their values mean.
class MaskFiles {
 public:
  /// `folder`: empty: no masks. `root`: links followed, files outside of it are not read (UsageError); empty: all are. Throws
  /// IoError, FormatError.
  MaskFiles(const std::string& folder, std::string root);
  /// 0 to 255; empty where there is none. Throws IoError, FormatError.
  Image At(int64_t number) const;

 private:
  std::string root_;
  FilesByNumber files_;
  dataset::MaskMeaning meaning_;
};

}  // namespace mvstudio::stages
