#include "core/disk/manifest_write.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <filesystem>
#include <thread>

#include "core/disk/files.h"
#include "core/disk/lock.h"
#include "core/disk/parents.h"
#include "core/disk/system_calls.h"
#include "core/disk/temporary.h"
#include "core/error.h"
#include "core/parallel.h"

namespace mvstudio::internal {
namespace fs = std::filesystem;

namespace {

/// The right to change a folder's manifest: processes that write different files into one folder wait for each other.
class ManifestLock {
 public:
  explicit ManifestLock(const std::string& folder) : folder_(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    constexpr int kTries = 3000;
    if (folder_.fd < 0) ThrowErrno(folder, "cannot open the folder", errno);
    for (int i = 0; flock(folder_.fd, LOCK_EX | LOCK_NB) != 0; ++i) {
      if (errno != EWOULDBLOCK && errno != EINTR) return;  // a file system without locks
      if (i == kTries) throw LockedError(folder + ": another process does not let go of its list of files; try again");
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }

 private:
  Descriptor folder_;
};

/// The folder whose manifest lists the file; for a new one the folder it lies in, or below an output that this process has
/// locked the innermost folder that has a manifest.
std::string HomeOf(const std::string& path) {
  for (std::string folder = ParentOf(path);; folder = ParentOf(folder)) {
    const std::optional<Manifest> manifest = ReadManifest(folder);
    const std::string relative = path.substr(folder == "/" ? 1 : folder.size() + 1);
    if (manifest && manifest->files.count(relative)) return folder;
    if (folder == "/") break;
  }
  const std::string locked = LockedFolderOf(path);
  if (locked.empty() || !fs::is_directory(locked)) return ParentOf(path);
  std::string folder = ParentOf(path);
  while (folder != locked && !Exists(folder + "/" + kManifestName)) folder = ParentOf(folder);
  return folder;
}

void RecordIn(const std::string& folder, const std::vector<std::pair<std::string, FileDigest>>& files) {
  const ManifestLock lock(folder);
  Manifest manifest = ReadManifest(folder).value_or(Manifest());
  std::tie(manifest.command, manifest.version) = WriterName();
  for (const auto& [path, digest] : files) {
    const auto [entry, is_new] = manifest.files.try_emplace(path.substr(folder == "/" ? 1 : folder.size() + 1));
    entry->second.before.reset();
    const bool file = Exists(path) && !fs::is_directory(fs::symlink_status(path));
    if (!is_new && file) entry->second.before = KnownDigest(path);
    entry->second.now = digest;
    entry->second.by = manifest.command;
    if (entry->second.before == digest) entry->second.before.reset();
  }
  WriteManifest(manifest, folder);
}

void ListAll(const std::string& folder, const std::string& prefix, std::vector<std::string>* names) {
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = prefix + entry.path().filename().string();
    if (name == kManifestName) continue;
    if (entry.is_directory() && !entry.is_symlink()) {
      names->push_back(name + "/");
      ListAll(entry.path().string(), name + "/", names);
    } else {
      names->push_back(name);
    }
  }
}

}  // namespace

void WriteManifest(const Manifest& manifest, const std::string& folder) {
  const std::string path = folder + "/" + kManifestName;
  const std::string temporary = TemporaryBeside(path);
  const Descriptor held(CreateTemporary(temporary, path));
  try {
    WriteFile(temporary, ManifestToJsonText(manifest));
    FlushToDisk(temporary);
    if (!Allowed("rename", path) || rename(temporary.c_str(), path.c_str()) != 0)
      ThrowErrno(path, "cannot rename into place", errno);
  } catch (...) {
    unlink(temporary.c_str());
    UnregisterTemporary(temporary);
    throw;
  }
  UnregisterTemporary(temporary);
}

void RecordWrites(const std::vector<std::pair<std::string, FileDigest>>& files) {
  std::map<std::string, std::vector<std::pair<std::string, FileDigest>>> by_home;
  for (const auto& [path, digest] : files) {
    const std::string normal = Normal(path);
    by_home[HomeOf(normal)].push_back({normal, digest});
  }
  for (const auto& [folder, some] : by_home) RecordIn(folder, some);
}

void ListWithin(const std::string& folder) {
  Manifest manifest = ReadManifest(folder).value_or(Manifest()), all = TakeInventory(folder);
  bool complete = true;
  for (const auto& [name, found] : all.files) {
    ManifestEntry& entry = manifest.files[name];
    if (name.back() == '/' || entry.now == found.now || entry.before == found.now) continue;
    entry = found, complete = false;
  }
  if (complete) return;
  std::tie(manifest.command, manifest.version) = WriterName();
  WriteManifest(manifest, folder);
}

Manifest TakeInventory(const std::string& folder) {
  std::vector<std::string> names;
  ListAll(folder, "", &names);
  std::vector<FileDigest> digests(names.size());
  ParallelFor(static_cast<int64_t>(names.size()), 0, [&](int64_t i) {
    if (names[i].back() != '/') digests[i] = KnownDigest(folder + "/" + names[i]);
  });
  Manifest manifest;
  std::tie(manifest.command, manifest.version) = WriterName();
  for (size_t i = 0; i < names.size(); ++i) manifest.files[names[i]].now = std::move(digests[i]);
  return manifest;
}

}  // namespace mvstudio::internal
