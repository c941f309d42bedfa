#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/disk/lock.h"

namespace mvstudio {

namespace internal {
class Claims;
}

/// Throws UsageError for an output folder that could hide or contain needed files. These are one that is, contains or is
/// inside an input; `/`, the home folder, the current folder or a parent of them; symbolic links to any of those. So are names
/// that mvstudio keeps for itself. Inputs that mvstudio wrote into that folder are allowed unless the folder is to be replaced
/// as a whole.
void RequireSafeOutput(const std::string& out, const std::vector<std::string>& inputs, bool replaced_as_a_whole);

/// Removes what killed processes left in a folder; each command does so where it writes.
void RemoveLeftovers(const std::string& folder);

/// A file that appears under its name when its set is committed. Until then it is hidden beside it, and removed on
/// destruction.
class AtomicFile {
 public:
  /// Throws UsageError when a file exists there that mvstudio did not write.
  explicit AtomicFile(const std::string& path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  const std::string& path() const { return path_; }
  /// The path to write to; the file exists and is empty.
  const std::string& temporary() const { return temporary_; }
  /// Commits this file alone.
  void Commit();

 private:
  friend void CommitTogether(const std::vector<AtomicFile*>& files);

  std::string path_, temporary_;
  std::vector<std::string> made_folders_;
  int fd_ = -1;
  bool committed_ = false, in_work_folder_ = false;
};

/// Flushes all files, then publishes them. By one exchange of their folder if that contains only files of mvstudio,
/// otherwise by one rename after the other in the given order.
void CommitTogether(const std::vector<AtomicFile*>& files);

/// A symbolic link at `path`, where nothing or an empty folder exists. Throws UsageError otherwise.
void PlaceLink(const std::string& target, const std::string& path);

/// A set of files: what this thread passes to WriteFileAtomic while this object lives is published by `Commit`, all or
/// nothing. A file that is written twice counts once.
class FilesTogether {
 public:
  FilesTogether();
  ~FilesTogether();
  FilesTogether(const FilesTogether&) = delete;
  FilesTogether& operator=(const FilesTogether&) = delete;
  void Commit();

  /// The set of this thread; nullptr when there is none.
  static FilesTogether* Current();
  /// Adds the file to the open set of this thread, or commits it.
  static void TakeOrCommit(std::unique_ptr<AtomicFile> file);
  void Take(std::unique_ptr<AtomicFile> file);

 private:
  FilesTogether* outer_;
  std::vector<std::unique_ptr<AtomicFile>> files_;
};

/// A new output folder that appears under its final name only when `Commit` is called. Until then it is a hidden folder
/// beside it, removed on destruction. An existing folder is replaced only when `overwrite` is set and mvstudio wrote
/// everything in it, unchanged; it stays complete until the new one is. A symbolic link to a folder is followed. One
/// writer at a time.
class AtomicFolder {
 public:
  /// `inputs`: the sources of the output, see RequireSafeOutput.
  AtomicFolder(const std::string& path, bool overwrite, const std::vector<std::string>& inputs = {});
  ~AtomicFolder();
  AtomicFolder(const AtomicFolder&) = delete;
  AtomicFolder& operator=(const AtomicFolder&) = delete;

  const std::string& work_path() const { return work_path_; }
  void Commit();

 private:
  void Swap();
  void SwapBack();
  void RemoveOld();

  std::string path_, work_path_;
  bool overwrite_, committed_ = false;
  std::unique_ptr<OutputLock> lock_;
  int fd_ = -1;
};

/// The right to write files with these names into a folder that may hold other things too. The place is safe for an
/// output, nobody else writes there, leftovers are removed, and each name is free or a file of mvstudio (otherwise
/// UsageError, before any work is done) and of one output of this run alone. Hold it until everything is written.
class OutputFolder {
 public:
  OutputFolder(const std::string& path, const std::vector<std::string>& inputs, const std::vector<std::string>& names);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

 private:
  OutputLock lock_;
  std::unique_ptr<internal::Claims> claims_;
};

/// Same for one file, or several that belong together: none of them is an input.
class OutputFiles {
 public:
  OutputFiles(const std::vector<std::string>& paths, const std::vector<std::string>& inputs);
  ~OutputFiles();
  OutputFiles(const OutputFiles&) = delete;
  OutputFiles& operator=(const OutputFiles&) = delete;

 private:
  std::unique_ptr<internal::Claims> claims_;
  std::vector<std::unique_ptr<OutputLock>> locks_;
};

/// A hidden folder in `parent` for intermediate files, removed with its content on destruction.
class ScratchFolder {
 public:
  explicit ScratchFolder(const std::string& parent);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  int fd_ = -1;
};

/// A new folder of an ordinary name for another program, which may call mvstudio in turn to write there. It is removed on
/// destruction with whatever was put into it. Throws IoError where something has that name.
class LentFolder {
 public:
  explicit LentFolder(const std::string& path);
  ~LentFolder();
  LentFolder(const LentFolder&) = delete;
  LentFolder& operator=(const LentFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace mvstudio
