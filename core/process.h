#pragma once

#include <functional>
#include <string>
#include <vector>

namespace mvstudio {

/// Where a program runs and writes.
struct ProcessFiles {
  std::string out;          ///< its stdout
  std::string err = {};     ///< its stderr; empty: into `out` too
  bool append = false;      ///< false: both are overwritten
  std::string folder = {};  ///< where it runs; empty: here. `out` and `err` are seen from here
};

/// Runs a program (a path, or a name on PATH) to its end without a shell, with an empty stdin and in a process group of its
/// own, so that signals from a terminal do not reach it. `poll` is called about 20
/// times a second; when it throws, the program is asked to end (SIGTERM), awaited, and the exception goes on. Returns the exit
/// status, or 128 + the signal that ended it. Throws IoError when it cannot be started.
int RunProcess(const std::vector<std::string>& words, const ProcessFiles& files, const std::function<void()>& poll = {});

}  // namespace mvstudio
