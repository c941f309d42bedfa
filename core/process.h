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
/// own, so that signals from a terminal do not reach it. `poll` is called about 20 times a second; when it throws, the program
/// and all that it started are asked to end (SIGTERM), killed after a second, and the exception goes on. Returns the exit
/// status, or 128 + the signal that ended it. Throws IoError when it cannot be started or awaited, CancelledError after
/// `EndChildren`.
int RunProcess(const std::vector<std::string>& words, const ProcessFiles& files, const std::function<void()>& poll = {});

/// For processes that are started otherwise: from now on `EndChildren` ends this one too. `group`: it leads a process group,
/// which is ended with it. Throws CancelledError after `EndChildren`.
void AddChild(int child, bool group);
/// To be called when it has been awaited.
void RemoveChild(int child);

/// For the moment before this process ends early: ends all children (SIGTERM, SIGKILL after a second) and awaits them. No other
/// can be started from then on.
void EndChildren();

}  // namespace mvstudio
