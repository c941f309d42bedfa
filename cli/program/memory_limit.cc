#include "cli/program/memory_limit.h"

#include <dlfcn.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "core/error.h"

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

}  // namespace mvstudio::cli
