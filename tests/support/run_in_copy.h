#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <functional>

namespace mvstudio::testing {

inline constexpr int kThrew = 99;

/// Runs `work` in a copy of this process, for what ends a process or changes it for good. Its exit status; kThrew after an
/// exception; 128 + the signal that ended it.
inline int RunInCopy(const std::function<int()>& work) {
  const pid_t copy = fork();
  if (copy == 0) {
    int code = kThrew;
    try {
      code = work();
    } catch (...) {
    }
    _exit(code);
  }
  int status = 0;
  waitpid(copy, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace mvstudio::testing
