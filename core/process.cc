#include "core/process.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>

#include "core/check.h"
#include "core/error.h"

namespace mvstudio {
namespace {

pid_t Start(const std::vector<std::string>& words, const ProcessFiles& files) {
  std::vector<char*> argv;
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  const int mode = O_WRONLY | O_CREAT | (files.append ? O_APPEND : O_TRUNC);
  posix_spawn_file_actions_addopen(&actions, 1, files.out.c_str(), mode, 0644);
  if (files.err.empty()) {
    posix_spawn_file_actions_adddup2(&actions, 1, 2);
  } else {
    posix_spawn_file_actions_addopen(&actions, 2, files.err.c_str(), mode, 0644);
  }
  if (!files.folder.empty()) posix_spawn_file_actions_addchdir_np(&actions, files.folder.c_str());
  posix_spawnattr_t attributes;  // a group of its own: Ctrl-C in a terminal is for the caller alone, who passes it on once
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  pid_t child = 0;
  const int error = posix_spawnp(&child, argv[0], &actions, &attributes, argv.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw IoError(words[0], std::string("cannot be started: ") + std::strerror(error));
  return child;
}

int Await(pid_t child) {
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

}  // namespace

int RunProcess(const std::vector<std::string>& words, const ProcessFiles& files, const std::function<void()>& poll) {
  MVS_CHECK(!words.empty(), "no program");
  const pid_t child = Start(words, files);
  int status = 0;
  while (true) {
    const pid_t ended = waitpid(child, &status, WNOHANG);
    if (ended == child || (ended < 0 && errno != EINTR)) break;
    try {
      if (poll) poll();
    } catch (...) {
      kill(child, SIGTERM);
      Await(child);
      throw;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace mvstudio
