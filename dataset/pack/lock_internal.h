#pragma once

#include <string>

namespace mvstudio::dataset::internal {

/// A lock file beside what it guards: flock, which the system gives up when its process ends however it ends, and the owner's
/// host, process and time of start in it for messages.
class FileLock {
 public:
  /// Does not wait; see `owned`. Throws IoError.
  explicit FileLock(const std::string& path);
  ~FileLock();  ///< Removes the file.
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

  bool owned() const { return fd_ >= 0; }
  /// Who has it when it is not ours: "process 123 on host, since 2026-01-01T00:00:00Z".
  const std::string& owner() const { return owner_; }

 private:
  bool TryOnce();
  std::string path_, owner_;
  int fd_ = -1;
};

}  // namespace mvstudio::dataset::internal
