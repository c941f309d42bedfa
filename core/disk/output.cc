#include "core/disk/output.h"

#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <mutex>
#include <set>
#include <utility>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/disk/manifest_write.h"
#include "core/disk/output_publish.h"
#include "core/disk/parents.h"
#include "core/disk/place.h"
#include "core/disk/replace.h"
#include "core/disk/system_calls.h"
#include "core/disk/temporary.h"
#include "core/disk/trace.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "core/log.h"

namespace mvstudio {
namespace fs = std::filesystem;
namespace {

using internal::Allowed;
using internal::MakeParents;
using internal::RemoveEmpty;
using internal::ThrowErrno;

void RequireReplaceable(const std::string& path) {
  struct stat info {};
  if (lstat(path.c_str(), &info) != 0) {
    if (errno != ENOENT) ThrowErrno(path, "cannot look at it", errno);
    return;
  }
  if (S_ISDIR(info.st_mode)) throw IoError(path, "is a folder, a file goes there");
  if (!S_ISREG(info.st_mode) && !S_ISLNK(info.st_mode))
    throw IoError(path, "is a device, a pipe or a socket; choose another name");
  RequireOurs({path});
  RequireNoResult(path);
}

std::vector<std::string> PathsOf(const std::vector<internal::Replacement>& replacements) {
  std::vector<std::string> paths;
  for (const internal::Replacement& replacement : replacements) paths.push_back(replacement.path);
  return paths;
}

}  // namespace

void RemoveLeftovers(const std::string& folder) { internal::SweepLeftovers(folder, true); }

namespace internal {
namespace {

std::mutex claims_mutex;

std::set<std::string>& Claimed() {
  static auto* claimed = new std::set<std::string>;
  return *claimed;
}

}  // namespace

/// Names of outputs that are being made: what has one already is not to be written over by another of the same run.
class Claims {
 public:
  explicit Claims(const std::vector<std::string>& paths) {
    const std::lock_guard<std::mutex> guard(claims_mutex);
    std::set<std::string> names;
    for (const std::string& path : paths) {
      const std::string name = Normal(NameOfFile(path));
      if (Claimed().count(name) > 0 || !names.insert(name).second)
        throw UsageError(path + ": two outputs of this run have this name; choose another one for one of them");
    }
    names_ = names;
    Claimed().insert(names.begin(), names.end());
  }
  ~Claims() {
    const std::lock_guard<std::mutex> guard(claims_mutex);
    for (const std::string& name : names_) Claimed().erase(name);
  }
  Claims(const Claims&) = delete;
  Claims& operator=(const Claims&) = delete;

 private:
  std::set<std::string> names_;
};

}  // namespace internal

// --- Single files ---

AtomicFile::AtomicFile(const std::string& path)
    : path_(internal::NameOfFile(path)), in_work_folder_(internal::InWorkFolder(path_)) {
  made_folders_ = MakeParents(path_);
  if (in_work_folder_) {
    temporary_ = path_;
    return;
  }
  try {
    RequireReplaceable(path_);
    internal::SweepLeftovers(internal::ParentOf(path_));
    temporary_ = internal::TemporaryBeside(path_);
    fd_ = internal::CreateTemporary(temporary_, path_);
  } catch (...) {
    RemoveEmpty(made_folders_);
    throw;
  }
}

AtomicFile::~AtomicFile() {
  if (fd_ >= 0) close(fd_);
  if (committed_ || in_work_folder_) return;
  unlink(temporary_.c_str());
  internal::UnregisterTemporary(temporary_);
  RemoveEmpty(made_folders_);
}

void AtomicFile::Commit() { CommitTogether({this}); }

void CommitTogether(const std::vector<AtomicFile*>& files) {
  std::vector<AtomicFile*> outside;
  for (AtomicFile* file : files) {
    if (file->in_work_folder_) continue;
    FlushToDisk(file->temporary_);
    outside.push_back(file);
  }
  std::vector<internal::Replacement> replacements;
  for (const AtomicFile* file : outside)
    replacements.push_back({internal::Normal(file->path_), file->temporary_, KnownDigest(file->temporary_)});
  const std::lock_guard<std::recursive_mutex> publish(internal::PublishMutex());
  for (const AtomicFile* file : outside) RequireReplaceable(file->path_);
  if (!replacements.empty()) internal::Publish(replacements);
  internal::RecordResults(PathsOf(replacements));
  for (const internal::Replacement& replacement : replacements) TracePublished(replacement.path);
  for (AtomicFile* file : files) {
    file->committed_ = true;
    internal::UnregisterTemporary(file->temporary_);
  }
}

void PlaceLink(const std::string& target, const std::string& given) {
  const std::string path = internal::OneName(given);
  const std::vector<std::string> made = MakeParents(path);
  const std::lock_guard<std::recursive_mutex> publish(internal::PublishMutex());
  if (internal::Exists(path) && (fs::is_symlink(path) || !fs::is_directory(path) || !fs::is_empty(path)))
    throw UsageError(path + ": is there already and not an empty folder; move it elsewhere");
  internal::RecordWrites({{internal::Normal(path), {target.size(), Sha256Hex(target.data(), target.size())}}});
  if ((rmdir(path.c_str()) != 0 && errno != ENOENT) || !Allowed("create", path) || symlink(target.c_str(), path.c_str()) != 0) {
    const int code = errno;
    RemoveEmpty(made);
    ThrowErrno(path, "cannot make the link", code);
  }
  TracePublished(path);
}

namespace {
thread_local FilesTogether* current_set = nullptr;
}

FilesTogether::FilesTogether() : outer_(std::exchange(current_set, this)) {}

FilesTogether::~FilesTogether() { current_set = outer_; }

FilesTogether* FilesTogether::Current() { return current_set; }

void FilesTogether::Take(std::unique_ptr<AtomicFile> file) {
  const auto same =
      std::find_if(files_.begin(), files_.end(), [&](const auto& other) { return other->path() == file->path(); });
  if (same != files_.end()) files_.erase(same);
  files_.push_back(std::move(file));
}

void FilesTogether::TakeOrCommit(std::unique_ptr<AtomicFile> file) {
  FilesTogether* set = internal::InWorkFolder(file->path()) ? nullptr : current_set;
  set ? set->Take(std::move(file)) : file->Commit();
}

void FilesTogether::Commit() {
  std::vector<AtomicFile*> files;
  for (const auto& file : files_) files.push_back(file.get());
  CommitTogether(files);
  files_.clear();
}

// --- Folders ---

AtomicFolder::AtomicFolder(const std::string& path, bool overwrite, const std::vector<std::string>& inputs)
    : path_(internal::FollowedFolder(path)), overwrite_(overwrite && MayReplace()) {
  RequireSafeOutput(path, inputs, true);
  if (internal::Exists(path_) && !fs::is_directory(path_)) throw UsageError(path + ": is a file; a folder goes there");
  lock_ = std::make_unique<OutputLock>(path_);
  if (internal::Exists(path_) && !fs::is_empty(path_)) {
    if (!overwrite_)
      throw ResultExistsError(path_, path + ": exists already; choose another option 'out' or pass option 'overwrite'");
    RequireOurs({path_});
  }
  MakeFolder(internal::ParentOf(path_));
  work_path_ = internal::TemporaryBeside(internal::ParentOf(path_) + "/work");
  fd_ = internal::CreateWorkFolder(work_path_, path_);
}

AtomicFolder::~AtomicFolder() {
  if (!committed_) {
    internal::RemoveWorkFolder(work_path_);
    internal::UnregisterTemporary(work_path_);
  }
  if (fd_ >= 0) close(fd_);
}

void AtomicFolder::Commit() {
  MVS_CHECK(!committed_, path_ << ": committed twice");
  const Manifest manifest = internal::TakeInventory(work_path_);
  internal::WriteManifest(manifest, work_path_);
  internal::FlushTree(work_path_, manifest);
  Swap();
  close(std::exchange(fd_, -1));
  try {
    FlushToDisk(internal::ParentOf(path_));
  } catch (...) {
    SwapBack();
    throw;
  }
  RemoveOld();
  TracePublished(path_);
}

void AtomicFolder::SwapBack() {
  const std::lock_guard<std::recursive_mutex> publish(internal::PublishMutex());
  try {
    const bool old = internal::Exists(work_path_);
    internal::SwapFolders(old ? work_path_ : path_, old ? path_ : work_path_);
    RemoveOurs({work_path_});
  } catch (const std::exception&) {  // on such a disk the new folder may stay
  }
}

void AtomicFolder::Swap() {
  const std::lock_guard<std::recursive_mutex> publish(internal::PublishMutex());
  if (internal::Exists(path_) && !fs::is_empty(path_)) {
    if (!overwrite_) throw UsageError(path_ + ": somebody put files there in the meantime; choose another option 'out'");
    RequireOurs({path_});
    internal::ListWithin(path_);  // under its hidden name it has to be known as ours still
  }
  internal::SwapFolders(work_path_, path_);
  committed_ = true;
  internal::UnregisterTemporary(work_path_);
}

void AtomicFolder::RemoveOld() {
  internal::RemoveOlder(path_, [this] {
    if (!internal::Exists(work_path_)) return;
    const std::vector<std::string> added = FilesInTheWay(work_path_);
    if (added.empty()) return RemoveOurs({work_path_});
    // Somebody wrote into the old folder between our last look and the exchange: that is kept, where it can be found.
    Log(LogLevel::kWarning, path_ + ": " + fs::path(added.front()).lexically_relative(work_path_).string() +
                                " was added to the older output at the last moment; that is kept beside it as " +
                                fs::path(work_path_).filename().string());
  });
}

OutputFolder::OutputFolder(const std::string& path, const std::vector<std::string>& inputs,
                           const std::vector<std::string>& names)
    : lock_((RequireSafeOutput(path, inputs, false), internal::FollowedFolder(path))) {
  if (internal::Exists(path) && !fs::is_directory(path)) throw UsageError(path + ": is a file; a folder goes there");
  std::vector<std::string> paths;
  for (const std::string& name : names) paths.push_back(path + "/" + name);
  claims_ = std::make_unique<internal::Claims>(paths);
  RequireOurs(paths);
  for (const std::string& name : paths) RequireNoResult(name);
}

OutputFolder::~OutputFolder() = default;

OutputFiles::OutputFiles(const std::vector<std::string>& paths, const std::vector<std::string>& inputs)
    : claims_(std::make_unique<internal::Claims>(paths)) {
  for (const std::string& path : paths) {
    RequireFreeName(path);
    for (const std::string& input : inputs) {
      std::error_code error;
      if (fs::equivalent(path, input, error))
        throw UsageError(path + ": is the input " + input + " itself; choose another option 'out'");
    }
    locks_.insert(locks_.begin(), std::make_unique<OutputLock>(path));  // the first goes last: it may have made the folder
    RequireReplaceable(path);
    const std::string writer = WriterOf(path), now = WriterName().first;
    if (internal::Exists(path) && writer != now)
      throw UsageError(path + ": was written by `mvstudio " + writer + "` and is no output of `" + now +
                       "`; choose another option 'out'");
  }
}

OutputFiles::~OutputFiles() = default;

ScratchFolder::ScratchFolder(const std::string& parent) : path_(internal::TemporaryBeside(parent + "/scratch")) {
  MakeFolder(parent);
  internal::SweepLeftovers(parent);
  fd_ = internal::CreateWorkFolder(path_, parent);
}

ScratchFolder::~ScratchFolder() {
  internal::RemoveWorkFolder(path_);
  internal::UnregisterTemporary(path_);
  close(fd_);
}

LentFolder::LentFolder(const std::string& path) : path_(path) {
  MakeFolder(internal::ParentOf(path_));
  if (!Allowed("folder", path_) || mkdir(path_.c_str(), 0777) != 0) ThrowErrno(path_, "cannot create folder", errno);
  internal::RegisterTemporary(path_, path_, internal::TemporaryKind::kFolder);  // goes at an early exit, too
}

LentFolder::~LentFolder() {
  internal::RemoveWorkFolder(path_);
  internal::UnregisterTemporary(path_);
}

}  // namespace mvstudio
