#pragma once

#include <functional>
#include <string>
#include <vector>

namespace mvstudio {

/// Runs a program (a path, or a name on PATH) to its end without a shell; its stdin is empty, stdout and stderr go to files
/// that are overwritten. `poll` is called about 20 times a second; when it throws, the program is interrupted (SIGINT),
/// awaited, and the exception goes on. Returns the exit status, or 128 + the signal that ended it. Throws IoError when it
/// cannot be started.
int RunProcess(const std::vector<std::string>& words, const std::string& stdout_path, const std::string& stderr_path,
               const std::function<void()>& poll = {});

}  // namespace mvstudio
