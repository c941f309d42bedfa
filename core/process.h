#pragma once

#include <functional>
#include <string>
#include <vector>

namespace mvstudio {

/// Working folder and output files of a program.
struct ProcessFiles {
  std::string out;          ///< its stdout
  std::string err = {};     ///< its stderr; empty: `out`
  bool append = false;      ///< false: both are overwritten
  std::string folder = {};  ///< working folder; empty: the current one. `out` and `err` are relative to the current one
};

/// Runs a program (a path, or a name on PATH) to its end without a shell, with an empty stdin and in its own process
/// group, so that signals from a terminal do not reach it. `poll` is called about 20 times a second. When it throws, the
/// program and its children receive SIGTERM, are killed after a second, and the exception propagates. Returns the exit
/// status, or 128 + the signal that ended it. Throws IoError when it cannot be started or awaited, CancelledError after
/// `EndChildren`.
int RunProcess(const std::vector<std::string>& words, const ProcessFiles& files, const std::function<void()>& poll = {});

/// For processes started otherwise: `EndChildren` then ends this one too. `group`: it leads a process group, which is
/// ended with it. Throws CancelledError after `EndChildren`.
void AddChild(int child, bool group);
/// Call it after the child was awaited.
void RemoveChild(int child);

/// For an early exit of this process: ends all children (SIGTERM, SIGKILL after a second) and awaits them. No others can
/// be started afterwards.
void EndChildren();

}  // namespace mvstudio
