// Private: for the checks of datasets, imports included.
#pragma once

#include <string>
#include <vector>

#include "core/error.h"
#include "dataset/verify/verify.h"

namespace mvstudio::dataset::internal {

class Findings {
 public:
  void Error(const std::string& code, const std::string& path, const std::string& text) {
    list_.push_back({Finding::Severity::kError, code, path, text});
  }
  void Warning(const std::string& code, const std::string& path, const std::string& text) {
    list_.push_back({Finding::Severity::kWarning, code, path, text});
  }
  void Add(const Finding& finding) { list_.push_back(finding); }
  void Append(const Findings& other) { list_.insert(list_.end(), other.list_.begin(), other.list_.end()); }
  const std::vector<Finding>& list() const { return list_; }

 private:
  std::vector<Finding> list_;
};

/// The part of a FormatError's message after the path.
std::string WithoutPath(const FormatError& error);
/// "frame: 12" or "3 frames: 12, 15, 19" (at most five are named).
std::string FramesText(const std::vector<int>& frames);

}  // namespace mvstudio::dataset::internal
