#pragma once

#include <string>

#include "core/error.h"

namespace mvstudio {

/// Somebody else is writing there (exit code 75). The message names who.
class LockedError : public Error {
 public:
  using Error::Error;
};

/// The right to write into an output folder, or to one file: one process at a time (`flock` on a hidden file beside it, which
/// names the holder). The same process may take it again. The folder that is locked holds the manifest of all that is written
/// below it. Throws LockedError when another process has it.
class OutputLock {
 public:
  explicit OutputLock(const std::string& path);
  ~OutputLock();
  OutputLock(const OutputLock&) = delete;
  OutputLock& operator=(const OutputLock&) = delete;

 private:
  std::string key_;
};

/// The same on a file of a name of its own, without an exception: `owned()` is false when another process has it.
class FileLock {
 public:
  /// `shown`: what messages call it; the folder of the lock file unless given.
  explicit FileLock(const std::string& lock_path, const std::string& shown = "");
  ~FileLock();
  FileLock(FileLock&& other) noexcept;
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;
  FileLock& operator=(FileLock&&) = delete;

  bool owned() const { return fd_ >= 0; }
  /// Who has it, when it is not ours.
  const std::string& owner() const { return owner_; }

 private:
  bool TryOnce();

  std::string path_, shown_, owner_;
  int fd_ = -1;
};

namespace internal {

/// The folder that this process has locked and that `path` lies in, the innermost; empty when there is none.
std::string LockedFolderOf(const std::string& path);

/// Name of the lock file beside an output.
std::string LockPathOf(const std::string& output);

/// Begins every lock file of ours; a file with another beginning is somebody else's.
inline constexpr char kLockText[] = "mvstudio lock: ";

}  // namespace internal
}  // namespace mvstudio
