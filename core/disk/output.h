#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/disk/lock.h"

namespace mvstudio {

/// Refuses, as UsageError, an output folder that could hide or hold what somebody needs: one that is, contains or lies in an
/// input; `/`, the home folder, the current folder or what contains them; symbolic links to any of those. Inputs that mvstudio
/// wrote into that very folder are no obstacle unless the folder is to be replaced as a whole.
void RequireSafeOutput(const std::string& out, const std::vector<std::string>& inputs, bool replaced_as_a_whole);

/// Removes what killed processes left in a folder; each command does so where it writes.
void RemoveLeftovers(const std::string& folder);

/// A file that appears under its name when its set is committed: until then it is hidden beside it, and removed on destruction.
class AtomicFile {
 public:
  /// Throws UsageError when a file is there that is not ours.
  explicit AtomicFile(const std::string& path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  const std::string& path() const { return path_; }
  /// Where to write; the file is there and empty.
  const std::string& temporary() const { return temporary_; }
  /// A set of one.
  void Commit();

 private:
  friend void CommitTogether(const std::vector<AtomicFile*>& files);

  std::string path_, temporary_;
  std::vector<std::string> made_folders_;
  int fd_ = -1;
  bool committed_ = false, in_work_folder_ = false;
};

/// Flushes all of them, then publishes them: all by one exchange of their folder when that holds nothing but files of ours,
/// otherwise one rename after the other, in the order given.
void CommitTogether(const std::vector<AtomicFile*>& files);

/// A symbolic link at `path`, where nothing is yet or an empty folder. Throws UsageError when there is anything else.
void PlaceLink(const std::string& target, const std::string& path);

/// Files that belong together: what this thread hands to WriteFileAtomic while this object lives is published by `Commit`, all
/// of it, or never. A file that is written twice counts once.
class FilesTogether {
 public:
  FilesTogether();
  ~FilesTogether();
  FilesTogether(const FilesTogether&) = delete;
  FilesTogether& operator=(const FilesTogether&) = delete;
  void Commit();

  /// The one of this thread; nullptr when there is none.
  static FilesTogether* Current();
  /// Gives the file to the set that is open on this thread, else commits it.
  static void TakeOrCommit(std::unique_ptr<AtomicFile> file);
  void Take(std::unique_ptr<AtomicFile> file);

 private:
  FilesTogether* outer_;
  std::vector<std::unique_ptr<AtomicFile>> files_;
};

/// A new output folder that appears under its final name only when `Commit` is called: until then it is a hidden folder beside
/// it, removed on destruction. A folder that is there already is replaced only when `overwrite` is set and all that is in it is
/// ours and unchanged; it stays whole until the new one is. A symbolic link to a folder is followed. One writer at a time.
class AtomicFolder {
 public:
  /// `inputs`: what the output is made from, see RequireSafeOutput.
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

/// The right to write files with these names into a folder that may hold other things, too: the place is safe for an output,
/// nobody else writes there, leftovers are gone, and each name is free or ours (otherwise UsageError, before any work is done).
/// Hold it until all is written.
class OutputFolder {
 public:
  OutputFolder(const std::string& path, const std::vector<std::string>& inputs, const std::vector<std::string>& names);

 private:
  OutputLock lock_;
};

/// The same for one file, or several that go together: none of them is an input.
class OutputFiles {
 public:
  OutputFiles(const std::vector<std::string>& paths, const std::vector<std::string>& inputs);

 private:
  std::vector<std::unique_ptr<OutputLock>> locks_;
};

/// A hidden folder for files in between, removed with all that is in it at the end. Made in `parent`.
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

}  // namespace mvstudio
