#pragma once

#include <string>

#include "core/error.h"

namespace mvstudio {

/// Another process is writing there (exit code 75). The message names it.
class LockedError : public Error {
 public:
  using Error::Error;
};

/// Throws LockedError where another program has the file open for writing and says so by `flock`, as HDF5 does: what it holds
/// may be half written.
void RequireNoWriter(const std::string& path);

/// Exclusive right to write into an output folder, or to one file: one process at a time (`flock` on a hidden file beside
/// it, which names the holder). The same process may lock it again. The locked folder holds the manifest of everything
/// written below it. Throws LockedError when another process holds it.
class OutputLock {
 public:
  explicit OutputLock(const std::string& path);
  ~OutputLock();
  OutputLock(const OutputLock&) = delete;
  OutputLock& operator=(const OutputLock&) = delete;

 private:
  std::string key_;
};

/// While one lives, outputs that were locked in it stay locked when their OutputLock goes: what is recorded about a run is
/// written before anybody else may write there. Scopes nest; each gives back its own.
class OutputLockScope {
 public:
  OutputLockScope();
  ~OutputLockScope();
  OutputLockScope(const OutputLockScope&) = delete;
  OutputLockScope& operator=(const OutputLockScope&) = delete;
};

/// Gives back what only scopes hold, for a child of this process that is to write there.
void ReleaseIdleOutputs();

/// Same on a separately named file, without an exception: `owned()` is false when another process holds it.
class FileLock {
 public:
  /// `shown`: the name in messages; by default the folder of the lock file.
  explicit FileLock(const std::string& lock_path, const std::string& shown = "");
  ~FileLock();
  FileLock(FileLock&& other) noexcept;
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;
  FileLock& operator=(FileLock&&) = delete;

  bool owned() const { return fd_ >= 0; }
  /// The holder, when it is another process.
  const std::string& owner() const { return owner_; }

 private:
  bool TryOnce();

  std::string path_, shown_, owner_;
  int fd_ = -1;
};

namespace internal {

/// The innermost folder that this process has locked and that contains `path`; empty when there is none.
std::string LockedFolderOf(const std::string& path);

/// Whether an absolute path is an output that this process has locked, or below one.
bool InLockedOutput(const std::string& folder);

/// Name of the lock file beside an output.
std::string LockPathOf(const std::string& output);

/// Start of every lock file of mvstudio; a file with another start belongs to another program.
inline constexpr char kLockText[] = "mvstudio lock: ";

}  // namespace internal
}  // namespace mvstudio
