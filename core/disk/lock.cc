#include "core/disk/lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <iterator>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/parents.h"
#include "core/disk/system_calls.h"
#include "core/disk/temporary.h"
#include "core/hash/sha256.h"

namespace mvstudio {
namespace {

using internal::kLockText;

std::string Myself() {
  char host[256] = "";
  gethostname(host, sizeof(host) - 1);
  char time_text[32];
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::strftime(time_text, sizeof(time_text), "%Y-%m-%dT%H:%M:%SZ", &utc);
  const std::string command = WriterName().first;
  return kLockText + std::string("process ") + std::to_string(getpid()) + (command.empty() ? "" : " (" + command + ")") +
         " on " + host + ", since " + time_text;
}

std::string TextOf(int fd) {
  char text[512];
  const ssize_t count = pread(fd, text, sizeof(text), 0);
  return count > 0 ? std::string(text, static_cast<size_t>(count)) : "";
}

struct Held {
  Held(FileLock lock_, std::vector<std::string> made) : lock(std::move(lock_)), made_folders(std::move(made)) {}
  FileLock lock;
  std::vector<std::string> made_folders;  // for its sake: they go again when nothing came into them
  int count = 1;
  int idle_depth = 0;  // of the scope in which `count` became 0
  pid_t process = getpid();
};

struct HeldLocks {
  std::recursive_mutex mutex;             // sweeping asks what is locked
  std::map<std::string, Held> by_output;  // normal path of what is locked
  int depth = 0;                          // of OutputLockScope
};

HeldLocks& AllHeld() {
  static auto* held = new HeldLocks;
  return *held;
}

/// Those that no OutputLock holds and that became so in a scope of this depth or a deeper one.
void ReleaseIdle(HeldLocks& held, int depth) {
  std::vector<std::string> made;
  for (auto at = held.by_output.begin(); at != held.by_output.end();) {
    const Held& lock = at->second;
    const bool idle = lock.count == 0 && lock.idle_depth >= depth && lock.process == getpid();
    if (idle) made.insert(made.end(), lock.made_folders.begin(), lock.made_folders.end());
    at = idle ? held.by_output.erase(at) : std::next(at);
  }
  internal::RemoveEmpty(made);
}

/// Beside the output; inside it where the folder around it cannot be written to.
FileLock LockBeside(const std::string& output, std::vector<std::string>* made_folders) {
  const std::string parent = internal::ParentOf(output);
  const std::string beside = internal::LockPathOf(output);
  struct stat info {};
  const bool inside = access(parent.c_str(), W_OK) != 0 && stat(output.c_str(), &info) == 0 && S_ISDIR(info.st_mode);
  if (!inside) *made_folders = internal::MakeParents(output);
  return FileLock(inside ? output + "/.mvstudio.this.lock" : beside, output);
}

}  // namespace

FileLock::FileLock(const std::string& lock_path, const std::string& shown)
    : path_(lock_path), shown_(shown.empty() ? internal::ParentOf(lock_path) : shown) {
  // Whoever had the file may remove it between our opening and locking it: then we hold a file without a name and try again.
  while (!TryOnce()) {
  }
}

bool FileLock::TryOnce() {
  if (!internal::Allowed("create", path_)) internal::ThrowErrno(shown_, "cannot write there", errno);
  const int fd = open(path_.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK, 0644);
  if (fd < 0 && errno == ELOOP) throw UsageError(path_ + ": is a symbolic link where a lock file goes; remove it");
  if (fd < 0 && errno == EISDIR) throw UsageError(path_ + ": is a folder where a lock file goes; move it elsewhere");
  if (fd < 0) internal::ThrowErrno(shown_, "cannot write there", errno);
  struct stat mine {
  }, named{};
  const std::string before = TextOf(fd);
  if (fstat(fd, &mine) != 0 || !S_ISREG(mine.st_mode) || (!before.empty() && before.rfind(kLockText, 0) != 0)) {
    close(fd);
    throw UsageError(path_ + ": is in the way of a lock file and not one of ours; move it elsewhere");
  }
  if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
    const std::string text = TextOf(fd);
    owner_ = text.size() > std::strlen(kLockText) ? text.substr(std::strlen(kLockText)) : "another process";
    close(fd);
    return true;
  }
  if (lstat(path_.c_str(), &named) != 0 || mine.st_ino != named.st_ino) {
    close(fd);
    return false;
  }
  fd_ = fd;
  internal::RegisterTemporary(path_, path_, internal::TemporaryKind::kLock);
  const std::string text = Myself();
  // Only for messages: a full disk does not matter here.
  if (ftruncate(fd, 0) == 0 && pwrite(fd, text.data(), text.size(), 0) < 0) errno = 0;
  return true;
}

void RequireNoWriter(const std::string& path) {
  const internal::Descriptor file(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (file.fd < 0 || flock(file.fd, LOCK_SH | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;  // the reader says what is wrong
  throw LockedError(path + ": is open for writing in another program; close it there, and try again");
}

FileLock::FileLock(FileLock&& other) noexcept
    : path_(std::move(other.path_)), shown_(std::move(other.shown_)), owner_(std::move(other.owner_)), fd_(other.fd_) {
  other.fd_ = -1;
}

FileLock::~FileLock() {
  if (fd_ < 0) return;
  unlink(path_.c_str());
  internal::UnregisterTemporary(path_);
  close(fd_);
}

OutputLock::OutputLock(const std::string& path) : key_(internal::Normal(path)) {
  const std::lock_guard<std::recursive_mutex> publish(internal::PublishMutex());  // before the other mutex, as commits do
  HeldLocks& held = AllHeld();
  const std::lock_guard<std::recursive_mutex> guard(held.mutex);
  const auto found = held.by_output.find(key_);
  if (found != held.by_output.end() && found->second.process == getpid()) {
    ++found->second.count;
    return;
  }
  if (found != held.by_output.end()) {  // inherited by a fork: not ours to give back
    new Held(std::move(found->second));
    held.by_output.erase(found);
  }
  internal::SweepLeftovers(internal::ParentOf(key_), true);
  internal::SweepLeftovers(key_, true);
  std::vector<std::string> made;
  FileLock lock = LockBeside(key_, &made);
  if (!lock.owned())
    throw LockedError(path + ": is being written by " + lock.owner() + "; wait for it, or choose another option 'out'");
  held.by_output.emplace(key_, Held(std::move(lock), std::move(made)));
}

OutputLock::~OutputLock() {
  HeldLocks& held = AllHeld();
  const std::lock_guard<std::recursive_mutex> guard(held.mutex);
  const auto found = held.by_output.find(key_);
  if (found == held.by_output.end() || --found->second.count > 0) return;
  found->second.idle_depth = held.depth;
  if (held.depth == 0) ReleaseIdle(held, 0);
}

OutputLockScope::OutputLockScope() {
  HeldLocks& held = AllHeld();
  const std::lock_guard<std::recursive_mutex> guard(held.mutex);
  ++held.depth;
}

OutputLockScope::~OutputLockScope() {
  HeldLocks& held = AllHeld();
  const std::lock_guard<std::recursive_mutex> guard(held.mutex);
  ReleaseIdle(held, held.depth--);
}

void ReleaseIdleOutputs() {
  HeldLocks& held = AllHeld();
  const std::lock_guard<std::recursive_mutex> guard(held.mutex);
  ReleaseIdle(held, 0);
}

namespace internal {

std::string LockedFolderOf(const std::string& path) {
  const std::string normal = Normal(path);
  HeldLocks& held = AllHeld();
  const std::lock_guard<std::recursive_mutex> guard(held.mutex);
  std::string best;
  for (const auto& [folder, lock] : held.by_output) {
    const bool below =
        normal.size() > folder.size() && normal.compare(0, folder.size(), folder) == 0 && normal[folder.size()] == '/';
    if (below && folder.size() > best.size()) best = folder;
  }
  return best;
}

bool InLockedOutput(const std::string& folder) {
  HeldLocks& held = AllHeld();
  const std::lock_guard<std::recursive_mutex> guard(held.mutex);
  return std::any_of(held.by_output.begin(), held.by_output.end(), [&](const auto& output) {
    const std::string& top = output.first;
    return folder.compare(0, top.size(), top) == 0 && (folder.size() == top.size() || folder[top.size()] == '/');
  });
}

std::string LockPathOf(const std::string& output) {
  const std::string normal = Normal(output);
  std::string name = normal.substr(normal.rfind('/') + 1);
  if (name.size() > 200) name = name.substr(0, 100) + "." + Sha256Hex(name.data(), name.size()).substr(0, 16);
  return ParentOf(normal) + "/.mvstudio." + name + ".lock";
}

}  // namespace internal
}  // namespace mvstudio
