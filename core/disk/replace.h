#pragma once

#include <string>
#include <vector>

namespace mvstudio {

/// Says for the life of the object whether this process may replace what an earlier one wrote. It may while there is no such
/// object. Scopes nest; the outermost decides, for a command that runs others was asked as a whole.
class ReplaceScope {
 public:
  explicit ReplaceScope(bool allowed);
  ~ReplaceScope();
  ReplaceScope(const ReplaceScope&) = delete;
  ReplaceScope& operator=(const ReplaceScope&) = delete;

 private:
  bool outermost_;
};

/// False where results of earlier runs are to be kept.
bool MayReplace();

/// Throws UsageError when `path` exists, this process did not write it, and results are to be kept.
void RequireNoResult(const std::string& path);

/// Throws IoError when nothing can be made where `folder` is or would be, ResourceError when its disk is full. Leaves nothing.
void RequireRoomIn(const std::string& folder);

namespace internal {
/// Remembers files that this process wrote: those it may write again.
void RecordResults(const std::vector<std::string>& paths);
}  // namespace internal

}  // namespace mvstudio
