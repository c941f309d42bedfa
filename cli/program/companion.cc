#include "cli/program/companion.h"

#include <dlfcn.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "core/error.h"
#include "core/process.h"

namespace mvstudio::cli {
namespace {

constexpr char kThreads[] = "OPENBLAS_NUM_THREADS";
constexpr size_t kBuffer = size_t{136} << 20;        // bytes that OpenBLAS takes at once, and a little more
constexpr rlim_t kAmple = rlim_t{4} << 30;           // bytes; beyond it the threads have what they need …
constexpr rlim_t kAmplePerThread = rlim_t{1} << 28;  // … each of them as much

size_t NumThreads() { return std::max(1u, std::thread::hardware_concurrency()); }

rlim_t LimitOf(int resource) {
  rlimit limit{};
  return getrlimit(static_cast<__rlimit_resource>(resource), &limit) == 0 ? limit.rlim_cur : RLIM_INFINITY;
}

bool NothingIsPromised() {
  char mode = 0;
  return (std::ifstream("/proc/sys/vm/overcommit_memory") >> mode) && mode == '2';
}

bool IsFree(size_t bytes) {
  void* at = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (at == MAP_FAILED) return false;
  munmap(at, bytes);
  return true;
}

/// OpenMP threads spin at every barrier before they sleep; on busy or small machines that makes training ten times slower.
/// Measured: 1.7 -> 18.7 steps/s beside two busy processes, and 13 -> 18 alone (2 cores). It is read before main() begins.
void ShortenSpins() {
  if (!std::getenv("OMP_WAIT_POLICY")) setenv("GOMP_SPINCOUNT", "1000", 0);
}

/// What the loader cannot map, and libtorch cannot set up, ends the program before its main() begins.
void RequireRoomFor(const std::string& path) {
  if (access(path.c_str(), X_OK) != 0) return;  // the start says why
  if (RunProcess({path, "--version"}, {"/dev/null", "/dev/null"}) == 0) return;
  throw ResourceError("the limit of the memory (ulimit -v, -d) is too low for mvstudio-avatar; raise it, to 1.5 GB at least");
}

}  // namespace

bool MemoryIsLimited() {
  const rlim_t ample = kAmple + NumThreads() * kAmplePerThread;
  return std::min(LimitOf(RLIMIT_AS), LimitOf(RLIMIT_DATA)) < ample || NothingIsPromised();
}

void LimitBlasThreads(char** argv) {
  const char* threads = std::getenv(kThreads);
  if (!MemoryIsLimited() || (threads && std::string(threads) == "1")) return;
  std::error_code unknown;
  const std::string own = std::filesystem::read_symlink("/proc/self/exe", unknown).string();
  if (setenv(kThreads, "1", 1) == 0) execv(own.c_str(), argv);  // comes back where that is not possible: go on as it is
}

void ReserveBlasMemory(bool needed) {
  if (!MemoryIsLimited()) return;
  const auto take = reinterpret_cast<void* (*)(int)>(dlsym(RTLD_DEFAULT, "blas_memory_alloc"));
  const auto give_back = reinterpret_cast<void (*)(void*)>(dlsym(RTLD_DEFAULT, "blas_memory_free"));
  if (!take || !give_back) return;  // another BLAS
  std::vector<void*> taken;
  // One for each thread of ours that may ask, as long as as much is left for everything else.
  while (taken.size() < NumThreads() && IsFree((taken.empty() ? 1 : 2) * kBuffer)) taken.push_back(take(0));
  for (void* buffer : taken) give_back(buffer);  // it stays OpenBLAS's
  if (needed && taken.empty()) throw ResourceError("the limit of the memory (ulimit -v, -d) leaves too little; raise it");
}

bool Trains(char** argv) {
  bool trains = false;
  for (char** word = argv; *word; ++word) trains = trains || !std::strcmp(*word, "avatar") || !std::strcmp(*word, "demo");
  return trains;
}

void HandOver(char** argv) {
  if (Trains(argv)) ShortenSpins();
  char own[PATH_MAX + 1] = "";
  const ssize_t size = readlink("/proc/self/exe", own, PATH_MAX);
  if (size <= 0) throw MissingToolError("cannot find mvstudio-avatar: /proc/self/exe cannot be read");
  const std::string path = std::filesystem::path(own).replace_filename("mvstudio-avatar").string();
  if (MemoryIsLimited()) RequireRoomFor(path);
  execv(path.c_str(), argv);
  throw MissingToolError("cannot start " + path + ": " + std::strerror(errno) +
                         "; it belongs beside mvstudio: copy or build both");
}

}  // namespace mvstudio::cli
