#pragma once

#include <dlfcn.h>
#include <sys/types.h>

#include <atomic>
#include <cstddef>
#include <cstdint>

// Inside of the fault library; what it does and how it is set stands in shim.cc.
namespace shim {

enum Class { kOpen, kCreate, kRead, kWrite, kFsync, kRename, kMkdir, kUnlink, kLink, kClose, kAlloc, kClasses };

// Read by program.py: keep in step.
struct Log {
  std::atomic<uint64_t> count[16];
  std::atomic<uint64_t> together;  // of the classes asked for
  std::atomic<uint64_t> hit;
  char what[1024];
  char trace[8192];
};

enum class Mode { kErrno, kKill, kKillAfter, kTorn };

struct Settings {
  bool active = false;
  unsigned classes = 0;
  uint64_t n = 0, most_hits = 1;
  int code = 0;
  Mode mode = Mode::kErrno;
  size_t least_bytes = 65536;
  char path[4096] = {};
  size_t path_length = 0;
  pid_t pid = 0;
  Log* log = nullptr;
};

extern Settings settings;

// Reads the environment and begins to count.
void Configure();

// Waits for requests and returns, in a copy of this process for each, the arguments and the environment asked for, as they lie
// on the stack of a new program.
char** Serve(int socket, int& argc);

using SyscallFunction = long (*)(long, ...);
SyscallFunction RawSyscall();

// One intercepted call. `Fails()` is asked before the real one is made; errno is set at the end of its life.
class Call {
 public:
  Call(Class kind, const char* function, int folder, const char* name);
  Call(Class kind, const char* function, int folder, const char* name, int folder2, const char* name2);
  Call(Class kind, const char* function, int fd);
  Call(const char* function, size_t bytes);
  ~Call();
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;

  bool Fails() const { return fails_; }
  bool torn() const { return torn_; }

 private:
  bool Idle();
  void Decide();
  void Count();

  const Class kind_;
  const char* const function_;
  bool busy_ = false, fails_ = false, after_ = false, torn_ = false;
  char path_[4096];
};

inline void* Next(const char* name) { return dlsym(RTLD_NEXT, name); }

}  // namespace shim

// A function of ours that stands under the name of one of libc, and the one that it stands for.
#define NAMED(name) __asm__(#name)
#define REAL(name) reinterpret_cast<decltype(&Shim_##name)>(shim::Next(#name))
