#include "cli/program/companion.h"

#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>

#include "cli/program/memory_limit.h"
#include "core/error.h"
#include "core/process.h"

namespace mvstudio::cli {
namespace {

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
