#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace mvstudio {

/// Whole content of a file. Throws IoError.
std::string ReadFile(const std::string& path);

/// Writes `content` beside `path`, flushes it to the disk, then renames it into place: afterwards `path` holds either the old
/// or the whole new content. Creates missing folders. Throws IoError, or ResourceError when the device is full.
void WriteFileAtomic(const std::string& path, std::string_view content);

/// Same for writers that need a path of their own: `write(temporary_path)` fills the file (it keeps the extension of `path`).
void WriteFileAtomic(const std::string& path, const std::function<void(const std::string&)>& write);

/// Creates or overwrites a file and writes `content`, not atomically: for the temporary path that the function above hands out.
void WriteFile(const std::string& path, std::string_view content);

/// Makes a file's content, or what was created, renamed or removed in a folder, survive a loss of power. Throws IoError or
/// ResourceError.
void FlushToDisk(const std::string& file_or_folder);

/// Removes a file; nothing happens when it is not there. Throws IoError.
void RemoveFile(const std::string& path);

/// Appends one line (a newline is added) in a single write.
void AppendLine(const std::string& path, std::string_view line);

/// Creates the folder and its parents. Throws IoError or ResourceError.
void MakeFolder(const std::string& path);

/// Files that match a pattern with `*` and `?` in any component, or all files of a folder, sorted. Empty when none.
std::vector<std::string> Glob(const std::string& pattern);

/// A new output folder that appears under its final name only when `Commit` is called: until then it is a hidden folder beside
/// it, removed on destruction. An existing folder at `path` is replaced on Commit only when `overwrite` is set and is restored
/// if the swap fails; otherwise construction throws UsageError.
class AtomicFolder {
 public:
  AtomicFolder(const std::string& path, bool overwrite);
  ~AtomicFolder();
  AtomicFolder(const AtomicFolder&) = delete;
  AtomicFolder& operator=(const AtomicFolder&) = delete;

  const std::string& work_path() const { return work_path_; }
  void Commit();

 private:
  std::string path_, work_path_;
  bool committed_ = false;
};

/// For tests of what happens when the disk fails or the process dies: called before each step of the functions above ("create",
/// "write", "flush", "close", "rename", "remove", "folder"). Returns 0, or the errno that the step then fails with.
using IoFault = int (*)(const char* operation, const std::string& path);
/// nullptr, which is how a program starts, means none. Returns the one before.
IoFault SetIoFault(IoFault fault);

}  // namespace mvstudio
