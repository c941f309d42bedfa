// LD_PRELOAD library that makes the n-th call of a class fail, or kills the program there. For tests of what a full disk, a
// dead disk, a lack of memory or a loss of power leaves behind. Set by the environment; nothing happens unless MVS_FAULT_PATH
// is set.
//
//   MVS_FAULT_PATH    only files below this folder count
//   MVS_FAULT_OP      classes that count together, with commas: open (for reading) create read write fsync rename mkdir
//                     unlink link close alloc
//   MVS_FAULT_N       the call that fails, from 1; 0: none, calls are only counted
//   MVS_FAULT_ERRNO   errno as a number; kill: SIGKILL before the call; killafter: after it; torn: after half of a write
//   MVS_FAULT_STICKY  1: every call from the n-th on fails, as on a disk that stays full
//   MVS_FAULT_BYTES   least size of the allocations that count; 65536 unless given
//   MVS_FAULT_LOG     file of at least sizeof(Log) bytes that receives counts, the call that was hit and where it came from
//   MVS_FAULT_SERVER  number of a socket: the loaded program becomes a server that forks a copy of itself for each
//                     request, which saves the half second of loading its libraries
//
// What libc does inside one of its own functions (the write behind fwrite, the open behind fopen) cannot be seen from here:
// there the outer function is what fails. Children are left alone: only the first process counts.
#include "tests/faults/shim.h"

#include <execinfo.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace shim {

Settings settings;

SyscallFunction RawSyscall() {
  static const auto real = reinterpret_cast<SyscallFunction>(Next("syscall"));
  return real;
}

namespace {

const char* const kNames[] = {"open",  "create", "read", "write", "fsync", "rename",
                              "mkdir", "unlink", "link", "close", "alloc"};
__attribute__((tls_model("initial-exec"))) thread_local bool inside = false;

void KillHere() {
  for (;;) RawSyscall()(SYS_kill, settings.pid, SIGKILL);
}

bool Below(const char* path) {
  return !std::strncmp(path, settings.path, settings.path_length) &&
         (path[settings.path_length] == '/' || !path[settings.path_length]);
}

// Path of an open descriptor; empty when it has none.
void PathOf(int fd, char* path, size_t size) {
  char link[64];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const int code = errno;
  const long length = RawSyscall()(SYS_readlinkat, AT_FDCWD, link, path, size - 1);
  path[length > 0 ? length : 0] = 0;
  errno = code;
}

bool Join(int folder, const char* name, char* path, size_t size) {
  if (!name) return false;
  if (name[0] == '/') {
    std::snprintf(path, size, "%s", name);
    return true;
  }
  if (folder == AT_FDCWD) {
    const long length = RawSyscall()(SYS_getcwd, path, size);
    if (length <= 0) return false;
  } else {
    PathOf(folder, path, size);
  }
  const size_t used = std::strlen(path);
  while (name[0] == '.' && name[1] == '/') name += 2;
  std::snprintf(path + used, size - used, "/%s", name);
  return true;
}

void KeepTrace(Log& log) {
  void* frames[48];
  const int count = backtrace(frames, 48);
  size_t used = 0;
  for (int i = 3; i < count && used + 300 < sizeof log.trace; ++i) {
    Dl_info info{};
    if (!dladdr(frames[i], &info) || !info.dli_fname) continue;
    const auto offset = reinterpret_cast<uintptr_t>(frames[i]) - reinterpret_cast<uintptr_t>(info.dli_fbase);
    const int length =
        std::snprintf(log.trace + used, sizeof log.trace - used, "%.200s+0x%zx\n", info.dli_fname, static_cast<size_t>(offset));
    used += static_cast<size_t>(length > 0 ? length : 0);
  }
}

}  // namespace

Call::Call(Class kind, const char* function, int folder, const char* name) : kind_(kind), function_(function) {
  if (Idle()) return;
  if (Join(folder, name, path_, sizeof path_)) Decide();
}

Call::Call(Class kind, const char* function, int folder, const char* name, int folder2, const char* name2)
    : kind_(kind), function_(function) {
  if (Idle()) return;
  const bool found = Join(folder, name, path_, sizeof path_) && Below(path_);
  if (found || Join(folder2, name2, path_, sizeof path_)) Decide();
}

Call::Call(Class kind, const char* function, int fd) : kind_(kind), function_(function) {
  if (Idle()) return;
  PathOf(fd, path_, sizeof path_);
  Decide();
}

Call::Call(const char* function, size_t bytes) : kind_(kAlloc), function_(function) {
  if (bytes < settings.least_bytes || Idle()) return;
  std::snprintf(path_, sizeof path_, "%zu bytes", bytes);
  Count();
}

Call::~Call() {
  if (after_) KillHere();
  if (busy_) inside = false;
  if (fails_) errno = settings.code;
}

bool Call::Idle() {
  if (!settings.active || inside || RawSyscall()(SYS_getpid) != settings.pid) return true;
  busy_ = inside = true;
  return false;
}

void Call::Decide() {
  if (path_[0] == '/' && Below(path_)) Count();
}

void Call::Count() {
  Log& log = *settings.log;
  ++log.count[kind_];
  if (!(settings.classes & (1u << kind_))) return;
  const uint64_t number = ++log.together;
  if (!settings.n || number < settings.n || number - settings.n >= settings.most_hits) return;
  if (log.hit++ == 0) {
    std::snprintf(log.what, sizeof log.what, "%s %s %.900s", kNames[kind_], function_, path_);
    KeepTrace(log);
  }
  if (settings.mode == Mode::kKill) KillHere();
  fails_ = settings.mode == Mode::kErrno;
  torn_ = settings.mode == Mode::kTorn;
  after_ = settings.mode == Mode::kKillAfter || torn_;
}

// ---- settings
// ----------------------------------------------------------------------------------------------------------------

namespace {

const char* Text(const char* name, const char* otherwise) {
  const char* value = std::getenv(name);
  return value ? value : otherwise;
}

unsigned ClassesOf(const char* list) {
  unsigned classes = 0;
  for (const char* at = list; *at;) {
    const size_t length = std::strcspn(at, ",");
    for (unsigned i = 0; i < kClasses; ++i) {
      if (std::strlen(kNames[i]) == length && !std::strncmp(at, kNames[i], length)) classes |= 1u << i;
    }
    at += length + (at[length] == ',');
  }
  return classes;
}

void SetMode(const char* text) {
  settings.code = std::atoi(text);
  if (!std::strcmp(text, "kill")) settings.mode = Mode::kKill;
  if (!std::strcmp(text, "killafter")) settings.mode = Mode::kKillAfter;
  if (!std::strcmp(text, "torn")) settings.mode = Mode::kTorn;
}

Log* OpenLog(const char* path) {
  const int fd = open(path, O_RDWR | O_CLOEXEC);
  if (fd < 0) return nullptr;
  void* const memory = mmap(nullptr, sizeof(Log), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  close(fd);
  return memory == MAP_FAILED ? nullptr : static_cast<Log*>(memory);
}

}  // namespace

void Configure() {
  const char* folder = Text("MVS_FAULT_PATH", "");
  if (!*folder) return;
  std::snprintf(settings.path, sizeof settings.path, "%s", folder);
  settings.path_length = std::strlen(settings.path);
  settings.classes = ClassesOf(Text("MVS_FAULT_OP", ""));
  settings.n = std::strtoull(Text("MVS_FAULT_N", "0"), nullptr, 10);
  settings.most_hits = *Text("MVS_FAULT_STICKY", "0") == '1' ? UINT64_MAX : 1;
  settings.least_bytes = std::strtoull(Text("MVS_FAULT_BYTES", "65536"), nullptr, 10);
  SetMode(Text("MVS_FAULT_ERRNO", "5"));
  settings.pid = getpid();
  settings.log = OpenLog(Text("MVS_FAULT_LOG", ""));
  void* frames[4];
  backtrace(frames, 4);  // its first call takes memory
  unsetenv("LD_PRELOAD");
  settings.active = settings.log != nullptr;
}

}  // namespace shim
