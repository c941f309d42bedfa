#include "core/disk/output_publish.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <set>

#include "core/disk/files.h"
#include "core/disk/manifest_write.h"
#include "core/disk/parents.h"
#include "core/disk/system_calls.h"
#include "core/disk/temporary.h"
#include "core/error.h"
#include "core/log.h"

namespace mvstudio::internal {
namespace fs = std::filesystem;
namespace {

constexpr size_t kMostCarried = 64;  // files of a folder that is exchanged for a set's sake
constexpr size_t kMostFlushedOneByOne = 64;

bool Rename(const std::string& from, const std::string& to, unsigned flags) {
  if (!Allowed("rename", to)) return false;
  return renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), flags) == 0;
}

/// Whether the file system or the kernel does not know the flag.
bool Unknown(int code) { return code == EINVAL || code == ENOSYS || code == ENOTSUP; }

void RenameIntoPlace(const std::string& from, const std::string& to) {
  // Nobody's file is replaced that came after the last look.
  const bool is_new = !Exists(to);
  if (is_new && Rename(from, to, RENAME_NOREPLACE)) return;
  if (is_new && errno == EEXIST)
    throw UsageError(to + ": somebody made that file in the meantime; choose another option 'out'");
  if (is_new && !Unknown(errno)) ThrowErrno(to, "cannot rename into place", errno);
  if (!Allowed("rename", to) || rename(from.c_str(), to.c_str()) != 0) ThrowErrno(to, "cannot rename into place", errno);
}

/// One rename after the other; when one fails, those before it are taken back.
void RenameAll(const std::vector<Replacement>& files) {
  std::vector<std::string> kept;  // second names of the files that are replaced; empty: it has none
  std::vector<char> is_new;
  size_t done = 0;
  const auto forget = [&] {
    for (const std::string& name : kept) {
      if (!name.empty()) unlink(name.c_str()), UnregisterTemporary(name);
    }
  };
  try {
    for (const Replacement& file : files) {
      const std::string second = TemporaryBeside(file.path);
      const bool last = &file == &files.back();
      if (!last) RegisterTemporary(second, file.path, TemporaryKind::kFile);
      is_new.push_back(!Exists(file.path));
      kept.push_back(!last && link(file.path.c_str(), second.c_str()) == 0 ? second : "");
      if (!last && kept.back().empty()) UnregisterTemporary(second);
      RenameIntoPlace(file.temporary, file.path);
      ++done;
    }
  } catch (...) {
    for (size_t i = 0; i < done; ++i) {
      if (!kept[i].empty()) {
        rename(kept[i].c_str(), files[i].path.c_str());
      } else if (is_new[i]) {  // a file that could not be kept is gone: the new one is better than none
        unlink(files[i].path.c_str());
      }
    }
    forget();
    throw;
  }
  forget();
}

/// The folder of all the files when it holds nothing but a few files of ours; otherwise nothing.
std::string FolderToExchange(const std::vector<Replacement>& files, std::vector<std::string>* others) {
  const std::string folder = ParentOf(files[0].path);
  std::set<std::string> mine;
  for (const Replacement& file : files) {
    if (ParentOf(file.path) != folder) return "";
    mine.insert({file.path, Normal(file.temporary)});
  }
  std::error_code error;
  if (files.size() < 2 || fs::is_symlink(folder) || fs::equivalent(folder, ".", error) ||
      access(ParentOf(folder).c_str(), W_OK) != 0)
    return "";
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string path = entry.path().string(), name = entry.path().filename().string();
    if (mine.count(path) || name == kManifestName) continue;
    if (entry.is_symlink() || !entry.is_regular_file() || !FilesInTheWay(path).empty()) return "";
    others->push_back(name);
    if (others->size() > kMostCarried) return "";
  }
  return folder;
}

void CarryOver(const std::string& folder, const std::string& work, const std::vector<std::string>& others) {
  struct stat info {};
  if (stat(folder.c_str(), &info) != 0 || chmod(work.c_str(), info.st_mode & 07777) != 0)
    ThrowErrno(folder, "cannot carry over its permissions", errno);
  for (const std::string& name : others) {
    if (!Allowed("create", folder + "/" + name) || link((folder + "/" + name).c_str(), (work + "/" + name).c_str()) != 0)
      ThrowErrno(folder + "/" + name, "cannot be linked", errno);
  }
}

/// Takes the old folder apart: second names and replaced files go, what came into it after it was copied moves into the new
/// one.
void RemoveExchanged(const std::string& old, const std::string& folder, const std::vector<Replacement>& files) {
  std::set<std::string> mine = {kManifestName};
  for (const Replacement& file : files) {
    mine.insert(fs::path(file.path).filename().string());
    mine.insert(fs::path(file.temporary).filename().string());
  }
  for (const auto& entry : fs::directory_iterator(old)) {
    const std::string name = entry.path().filename().string(), to = folder + "/" + name;
    struct stat before {
    }, now{};
    if (mine.count(name) || lstat(entry.path().c_str(), &before) != 0) continue;
    const bool carried = lstat(to.c_str(), &now) == 0 && before.st_ino == now.st_ino;
    if (carried) {
      unlink(entry.path().c_str());
    } else {
      rename(entry.path().c_str(), to.c_str());  // if that fails it stays, hidden: it is not ours to remove
    }
  }
  for (const std::string& name : mine) {
    if (name != kManifestName) unlink((old + "/" + name).c_str());
  }
  // The manifest goes last, and only when nothing else is left: by it the next command knows whose the rest is.
  for (const auto& entry : fs::directory_iterator(old)) {
    if (entry.path().filename() != kManifestName) throw IoError(entry.path().string(), "cannot be removed");
  }
  unlink((old + "/" + kManifestName).c_str());
  if (rmdir(old.c_str()) != 0) ThrowErrno(old, "cannot remove the folder", errno);
}

/// Publishes all files at one moment: a copy of their folder, made of links and with the new files in it, takes its place.
/// False, with everything as before, where the file system cannot do that.
bool ExchangeFolder(const std::string& folder, const std::vector<Replacement>& files, const std::vector<std::string>& others) {
  const std::string work = TemporaryBeside(folder + "-set");
  const Descriptor held(CreateWorkFolder(work, folder));
  bool exchanged = false;
  try {
    CarryOver(folder, work, others);
    Manifest manifest = ReadManifest(folder).value_or(Manifest());
    for (const Replacement& file : files) {
      const std::string name = fs::path(file.path).filename().string();
      if (!Allowed("create", file.path) || link(file.temporary.c_str(), (work + "/" + name).c_str()) != 0)
        ThrowErrno(file.path, "cannot be linked", errno);
      manifest.files[name] = {file.digest, {}, WriterName().first};
    }
    std::tie(manifest.command, manifest.version) = WriterName();
    WriteManifest(manifest, work);
    FlushToDisk(work);
    exchanged = Rename(work, folder, RENAME_EXCHANGE);
  } catch (const IoError&) {  // no hard links here: one rename after the other
  } catch (...) {
    RemoveWorkFolder(work);
    UnregisterTemporary(work);
    throw;
  }
  if (exchanged) {
    UnregisterTemporary(work);  // it is the old folder now, and nobody's to clear
    RemoveOlder(folder, [&] {
      if (Exists(work)) RemoveExchanged(work, folder, files);
    });
  } else {
    RemoveWorkFolder(work);
    UnregisterTemporary(work);
    return false;
  }
  FlushToDisk(ParentOf(folder));
  return true;
}

}  // namespace

void Publish(const std::vector<Replacement>& files) {
  std::vector<std::string> others;
  const std::string folder = FolderToExchange(files, &others);
  if (!folder.empty()) SweepLeftovers(ParentOf(folder));
  if (folder.empty() || !ExchangeFolder(folder, files, others)) {
    std::vector<std::pair<std::string, FileDigest>> written;
    for (const Replacement& file : files) written.push_back({file.path, file.digest});
    RecordWrites(written);
    std::set<std::string> folders;
    RenameAll(files);
    for (const Replacement& file : files) folders.insert(ParentOf(file.path));
    for (const std::string& parent : folders) FlushToDisk(parent);
  }
}

void RemoveOlder(const std::string& path, const std::function<void()>& remove) {
  constexpr int kTries = 2;
  for (int i = 1; i <= kTries; ++i) {
    try {
      return remove();
    } catch (const std::exception& error) {
      if (i == kTries)
        Log(LogLevel::kWarning, path + ": the older output is not all removed (" + error.what() +
                                    "); the next command that writes there does that");
    }
  }
}

void SwapFolders(const std::string& work, const std::string& path) {
  if (!Exists(path)) {
    if (Rename(work, path, RENAME_NOREPLACE)) return;
    if (!Unknown(errno)) ThrowErrno(path, "cannot rename into place", errno);
    if (rename(work.c_str(), path.c_str()) != 0) ThrowErrno(path, "cannot rename into place", errno);
    return;
  }
  if (Rename(work, path, RENAME_EXCHANGE)) return;
  if (!Unknown(errno)) ThrowErrno(path, "cannot exchange with the older folder", errno);
  const std::string old = OldFolderBeside(path);
  if (!Allowed("rename", old) || rename(path.c_str(), old.c_str()) != 0)
    ThrowErrno(path, "cannot move the old folder away", errno);
  if (!Allowed("rename", path) || rename(work.c_str(), path.c_str()) != 0) {
    const int code = errno;
    rename(old.c_str(), path.c_str());
    ThrowErrno(path, "cannot rename into place", code);
  }
  rename(old.c_str(), work.c_str());
}

void FlushTree(const std::string& folder, const Manifest& manifest) {
  if (manifest.files.size() > kMostFlushedOneByOne) {
    const Descriptor all(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (all.fd < 0) ThrowErrno(folder, "cannot reopen to flush", errno);
    if (!Allowed("flush", folder) || (syncfs(all.fd) != 0 && errno != ENOSYS)) ThrowErrno(folder, "cannot flush", errno);
    return;
  }
  for (const auto& [name, entry] : manifest.files) {
    if (!fs::is_symlink(fs::symlink_status(folder + "/" + name))) FlushToDisk(folder + "/" + name);
  }
  FlushToDisk(folder + "/" + kManifestName);
  FlushToDisk(folder);
}

std::string FollowedFolder(const std::string& path) {
  if (path.empty()) throw UsageError("the name of an output is empty; give a path");
  const std::string normal = Normal(path);
  if (!fs::is_symlink(fs::symlink_status(normal))) return normal;
  std::error_code error;
  const fs::path target = fs::canonical(normal, error);  // with the last link followed, too
  if (error) throw UsageError(path + ": is a symbolic link that leads nowhere; choose another option 'out'");
  return target.string();
}

}  // namespace mvstudio::internal
