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

}  // namespace mvstudio
