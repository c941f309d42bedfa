#include "core/disk/temporary.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <map>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include "core/disk/files.h"
#include "core/disk/lock.h"
#include "core/disk/manifest.h"
#include "core/disk/parents.h"
#include "core/disk/system_calls.h"
#include "core/error.h"

namespace mvstudio {
namespace fs = std::filesystem;
namespace {

using internal::Descriptor;
using internal::TemporaryKind;

constexpr char kPrefix[] = ".mvstudio-";         // of temporary files and folders
constexpr char kOldPrefix[] = ".mvstudio-old-";  // of a folder on its way out, where the file system cannot exchange two names
constexpr size_t kTagDigits = 32;

struct Item {
  std::string final_path;
  TemporaryKind kind;
};

struct Registry {
  std::mutex mutex;
  std::map<std::string, Item> alive;               // by normal path
  std::map<std::string, std::string> final_names;  // of those that are no more as well
  std::set<std::pair<pid_t, std::string>> swept;   // a forked process is another one
};

Registry& All() {
  static auto* registry = new Registry;  // threads may use it until the very end
  return *registry;
}

/// By which temporaries are known; their own names lead somewhere, those of other files need not.
std::string KeyOf(const std::string& path) {
  try {
    return internal::Normal(path);
  } catch (const std::exception&) {
    return path;
  }
}

bool IsBelow(const std::string& path, const std::string& folder) {
  return path.size() > folder.size() && path.compare(0, folder.size(), folder) == 0 && path[folder.size()] == '/';
}

void RemoveItem(const std::string& path, TemporaryKind kind) {
  if (kind != TemporaryKind::kFolder) {
    unlink(path.c_str());
    return;
  }
  for (int i = 0; i < 20; ++i) {  // other threads may still be writing into it
    internal::RemoveWorkFolder(path);
    if (!internal::Exists(path)) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

/// True when no process holds the lock of a temporary or lock file.
bool IsFree(int fd, bool folder) {
  if (folder) return flock(fd, LOCK_EX | LOCK_NB) == 0;
  struct flock whole {};
  whole.l_type = F_WRLCK;
  return fcntl(fd, F_OFD_SETLK, &whole) == 0;
}

/// Locks what was just made. False when another process took it for a leftover in between, and removes it. Where the file system
/// knows no locks nobody can.
bool Keep(int fd, bool folder, const std::string& path) {
  if (!IsFree(fd, folder) && (errno == EWOULDBLOCK || errno == EACCES)) return false;
  struct stat mine {
  }, named{};
  return fstat(fd, &mine) != 0 || (lstat(path.c_str(), &named) == 0 && mine.st_ino == named.st_ino);
}

/// Calls `make`, which returns a descriptor or -1 with errno, until what it made at `path` is kept; -1 with errno when it fails.
/// EAGAIN: swept before it could be opened.
template <class Make>
int MakeToKeep(const std::string& path, bool folder, const Make& make) {
  constexpr int kTries = 1000;
  for (int i = 0; i < kTries; ++i) {
    const int fd = make();
    const bool swept = fd < 0 && (errno == EAGAIN || (i > 0 && errno == EEXIST));  // by whoever has not removed it yet
    if ((fd < 0 && !swept) || (fd >= 0 && Keep(fd, folder, path))) return fd;
    if (fd >= 0) close(fd);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  errno = EBUSY;
  return -1;
}

/// What an interrupted swap moved away goes back unless the new folder is there.
void SweepOld(const std::string& path) {
  const std::optional<Manifest> manifest = ReadManifest(path);
  if (!manifest) return;
  const std::string name = fs::path(path).filename().string().substr(sizeof(kOldPrefix) - 1 + kTagDigits + 1);
  const std::string home = internal::ParentOf(path) + "/" + name;
  if (!internal::Exists(home)) {
    if (rename(path.c_str(), home.c_str()) != 0) return;
  } else {
    RemoveOurs({path});
  }
}

bool HoldsAtMostARecord(const std::string& folder) {
  const fs::directory_iterator begin(folder);
  return std::all_of(fs::begin(begin), fs::end(begin),
                     [](const auto& entry) { return entry.path().filename() == kManifestName; });
}

void SweepFolder(const std::string& path) {
  const Descriptor folder(open(path.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  if (folder.fd < 0 || !IsFree(folder.fd, true)) return;
  if (fs::path(path).filename().string().compare(0, sizeof(kOldPrefix) - 1, kOldPrefix) == 0) return SweepOld(path);
  std::optional<Manifest> manifest;
  try {
    manifest = ReadManifest(path);
  } catch (const Error&) {  // cut while it was written, as the first file of all
  }
  if (manifest && manifest->whole) {
    RemoveOurs({path});  // the old folder of a swap: what somebody added to it since stays
  } else if (manifest || HoldsAtMostARecord(path)) {
    internal::RemoveWorkFolder(path);  // once: after that the name may be somebody's again
  }
}

void SweepFile(const std::string& path, bool lock) {
  const Descriptor file(open(path.c_str(), O_RDWR | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK));
  struct stat opened {
  }, named{};
  if (file.fd < 0 || fstat(file.fd, &opened) != 0 || !S_ISREG(opened.st_mode) || !IsFree(file.fd, lock)) return;
  if (lock) {
    char text[sizeof(internal::kLockText)] = "";
    const ssize_t count = pread(file.fd, text, sizeof(text) - 1, 0);
    if (count != 0 && std::string(text) != internal::kLockText) return;
  }
  if (lstat(path.c_str(), &named) == 0 && named.st_ino == opened.st_ino) unlink(path.c_str());
}

bool HasTag(const std::string& name, size_t at) {
  if (name.size() < at + kTagDigits) return false;
  return std::all_of(name.begin() + static_cast<long>(at), name.begin() + static_cast<long>(at + kTagDigits),
                     [](unsigned char c) { return std::isxdigit(c) && !std::isupper(c); });
}

}  // namespace

namespace internal {

std::string RandomTag() {
  unsigned char bytes[kTagDigits / 2];
  size_t have = 0;
  while (have < sizeof(bytes)) {
    const ssize_t got = getrandom(bytes + have, sizeof(bytes) - have, 0);
    if (got < 0 && errno != EINTR) ThrowErrno("/dev/urandom", "gives no random numbers", errno);
    have += static_cast<size_t>(std::max<ssize_t>(got, 0));
  }
  std::string text;
  for (const unsigned char byte : bytes) {
    text += "0123456789abcdef"[byte >> 4];
    text += "0123456789abcdef"[byte & 15];
  }
  return text;
}

std::string TemporaryBeside(const std::string& final_path) {
  const std::string extension = fs::path(final_path).extension().string();
  return (fs::path(final_path).parent_path() / (kPrefix + RandomTag() + (extension.size() <= 16 ? extension : ""))).string();
}

void RemoveWorkFolder(const std::string& folder) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    if (entry.path().filename() != kManifestName) fs::remove_all(entry.path(), ignored);
  }
  fs::remove_all(folder, ignored);
}

std::string OldFolderBeside(const std::string& path) {
  return ParentOf(path) + "/" + kOldPrefix + RandomTag() + "-" + fs::path(path).filename().string();
}

int CreateTemporary(const std::string& temporary, const std::string& final_path) {
  const int flags = O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC;
  RegisterTemporary(temporary, final_path, TemporaryKind::kFile);
  const auto make = [&] { return open(temporary.c_str(), flags, 0666); };
  const int fd = Allowed("create", final_path) ? MakeToKeep(temporary, false, make) : -1;
  if (fd < 0) {
    const int code = errno;
    UnregisterTemporary(temporary);
    ThrowErrno(final_path, "cannot create", code);
  }
  return fd;
}

int CreateWorkFolder(const std::string& temporary, const std::string& final_path) {
  RegisterTemporary(temporary, final_path, TemporaryKind::kFolder);
  const auto make = [&] {
    if (mkdir(temporary.c_str(), 0777) != 0) return -1;
    const int made = open(temporary.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (made < 0 && errno == ENOENT) errno = EAGAIN;
    return made;
  };
  const int fd = Allowed("folder", final_path) ? MakeToKeep(temporary, true, make) : -1;
  if (fd < 0) {
    const int code = errno;
    rmdir(temporary.c_str());
    UnregisterTemporary(temporary);
    ThrowErrno(final_path, "cannot create folder", code);
  }
  Manifest unfinished;
  unfinished.whole = false;
  try {
    WriteFile(temporary + "/" + kManifestName, ManifestToJsonText(unfinished));
  } catch (...) {
    close(fd);
    RemoveItem(temporary, TemporaryKind::kFolder);
    UnregisterTemporary(temporary);
    throw;
  }
  return fd;
}

bool IsTemporaryName(const std::string& name) {
  if (name.compare(0, sizeof(kOldPrefix) - 1, kOldPrefix) == 0) return HasTag(name, sizeof(kOldPrefix) - 1);
  return name.compare(0, sizeof(kPrefix) - 1, kPrefix) == 0 && HasTag(name, sizeof(kPrefix) - 1);
}

bool IsLockName(const std::string& name) {
  constexpr char kEnd[] = ".lock";
  return name.compare(0, 10, ".mvstudio.") == 0 && name.size() > 15 && name.compare(name.size() - 5, 5, kEnd) == 0;
}

void RegisterTemporary(const std::string& path, const std::string& final_path, TemporaryKind kind) {
  const std::lock_guard<std::recursive_mutex> publish(PublishMutex());  // not after AbandonTemporaries
  const std::lock_guard<std::mutex> guard(All().mutex);
  All().alive[KeyOf(path)] = {final_path, kind};
  if (kind == TemporaryKind::kLock || All().final_names.size() >= 10000) return;
  All().final_names[path] = final_path;
  All().final_names[KeyOf(path)] = KeyOf(final_path);
}

void UnregisterTemporary(const std::string& path) {
  const std::lock_guard<std::mutex> guard(All().mutex);
  All().alive.erase(KeyOf(path));
}

bool InWorkFolder(const std::string& path) {
  const std::string normal = KeyOf(path);
  const std::lock_guard<std::mutex> guard(All().mutex);
  for (const auto& [folder, item] : All().alive) {
    if (item.kind == TemporaryKind::kFolder && IsBelow(normal, folder)) return true;
  }
  return false;
}

bool IsTemporaryHere(const std::string& path) {
  const std::lock_guard<std::mutex> guard(All().mutex);
  return All().alive.count(KeyOf(path)) > 0;
}

std::recursive_mutex& PublishMutex() {
  static auto* mutex = new std::recursive_mutex;
  return *mutex;
}

void SweepLeftovers(const std::string& folder, bool again) {
  {
    const std::lock_guard<std::mutex> guard(All().mutex);
    if (!All().swept.insert({getpid(), KeyOf(folder)}).second && !again) return;
  }
  std::error_code error;
  std::vector<std::string> found;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    const std::string name = at->path().filename().string();
    if (IsTemporaryName(name) || IsLockName(name)) found.push_back(at->path().string());
  }
  for (const std::string& path : found) {
    {
      const std::lock_guard<std::mutex> guard(All().mutex);
      if (All().alive.count(KeyOf(path))) continue;
    }
    try {
      const bool lock = IsLockName(fs::path(path).filename().string());
      if (!fs::is_directory(fs::symlink_status(path))) {
        SweepFile(path, lock);
      } else if (!lock) {  // no lock is a folder
        SweepFolder(path);
      }
    } catch (const std::exception&) {  // it stays where it is
    }
  }
}

}  // namespace internal

void AbandonTemporaries() {
  internal::PublishMutex().lock();  // for good
  std::map<std::string, Item> items;
  {
    const std::lock_guard<std::mutex> guard(All().mutex);
    items = All().alive;
  }
  for (const auto& [path, item] : items) RemoveItem(path, item.kind);
}

std::string FinalNames(std::string text) {
  const std::lock_guard<std::mutex> guard(All().mutex);
  if (text.find(kPrefix) == std::string::npos) return text;
  const auto& names = All().final_names;
  for (auto name = names.rbegin(); name != names.rend(); ++name) {  // what lies in a work folder before the folder itself
    const auto& [temporary, final_path] = *name;
    for (size_t at = text.find(temporary); at != std::string::npos; at = text.find(temporary, at + final_path.size()))
      text.replace(at, temporary.size(), final_path);
  }
  return text;
}

}  // namespace mvstudio
