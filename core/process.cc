#include "core/process.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <map>
#include <mutex>
#include <thread>

#include "core/check.h"
#include "core/error.h"

namespace mvstudio {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kStep(20), kPatience(1000);

/// The children that have not been awaited, each with whether it leads a group.
struct Children {
  std::mutex mutex;
  std::map<pid_t, bool> alive;
  bool ended = false;
};

Children& All() {
  static auto* children = new Children;  // another thread may end them while this one runs the destructors
  return *children;
}

struct SpawnSetup {
  SpawnSetup() {
    posix_spawn_file_actions_init(&actions);
    posix_spawnattr_init(&attributes);
  }
  ~SpawnSetup() {
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
  }
  SpawnSetup(const SpawnSetup&) = delete;
  SpawnSetup& operator=(const SpawnSetup&) = delete;
  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
};

void SetFiles(const ProcessFiles& files, posix_spawn_file_actions_t* actions) {
  posix_spawn_file_actions_addopen(actions, 0, "/dev/null", O_RDONLY, 0);
  const int mode = O_WRONLY | O_CREAT | (files.append ? O_APPEND : O_TRUNC);
  posix_spawn_file_actions_addopen(actions, 1, files.out.c_str(), mode, 0644);
  if (files.err.empty()) {
    posix_spawn_file_actions_adddup2(actions, 1, 2);
  } else {
    posix_spawn_file_actions_addopen(actions, 2, files.err.c_str(), mode, 0644);
  }
  if (!files.folder.empty()) posix_spawn_file_actions_addchdir_np(actions, files.folder.c_str());
}

/// A group of its own: Ctrl-C in a terminal is for the caller alone, who passes it on once. Signals that the caller ignores or
/// blocks are none of the program's business.
void SetSignals(posix_spawnattr_t* attributes) {
  sigset_t none, usual;
  sigemptyset(&none);
  sigemptyset(&usual);
  for (const int number : {SIGPIPE, SIGXFSZ, SIGCHLD}) sigaddset(&usual, number);
  posix_spawnattr_setsigmask(attributes, &none);
  posix_spawnattr_setsigdefault(attributes, &usual);
  posix_spawnattr_setpgroup(attributes, 0);
  posix_spawnattr_setflags(attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
}

void CheckNotEnded(const Children& children) {
  if (children.ended) throw CancelledError("interrupted");
}

pid_t Start(const std::vector<std::string>& words, const ProcessFiles& files) {
  std::vector<char*> argv;
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  SpawnSetup setup;
  SetFiles(files, &setup.actions);
  SetSignals(&setup.attributes);
  const std::lock_guard<std::mutex> lock(All().mutex);
  CheckNotEnded(All());
  pid_t child = 0;
  const int error = posix_spawnp(&child, argv[0], &setup.actions, &setup.attributes, argv.data(), environ);
  if (error != 0) throw IoError(words[0], std::string("cannot be started: ") + std::strerror(error));
  All().alive[child] = true;
  return child;
}

enum class Ending { kNotYet, kEnded, kUnknown };

/// Awaits the child if it has ended. Its number is free for others from then on, so it leaves the list at once.
Ending TryAwait(pid_t child, int* status) {
  const std::lock_guard<std::mutex> lock(All().mutex);
  const pid_t ended = waitpid(child, status, WNOHANG);
  if (ended == 0 || (ended < 0 && errno == EINTR)) return Ending::kNotYet;
  All().alive.erase(child);
  return ended == child ? Ending::kEnded : Ending::kUnknown;
}

void Signal(pid_t child, bool group, int number) { kill(group ? -child : child, number); }

/// Until `done` or the patience is over; false then.
bool WaitFor(const std::function<bool()>& done) {
  const auto end = Clock::now() + kPatience;
  while (!done()) {
    if (Clock::now() > end) return false;
    std::this_thread::sleep_for(kStep);
  }
  return true;
}

/// Ends a program and what it started. A group outlives its leader, so its number is still theirs.
void EndGroup(pid_t child) {
  int status = 0;
  Signal(child, true, SIGTERM);
  bool awaited = false;
  WaitFor([&] {
    awaited = awaited || TryAwait(child, &status) != Ending::kNotYet;
    return awaited && kill(-child, 0) != 0;
  });
  Signal(child, true, SIGKILL);
  while (!awaited && TryAwait(child, &status) == Ending::kNotYet) std::this_thread::sleep_for(kStep);
}

}  // namespace

int RunProcess(const std::vector<std::string>& words, const ProcessFiles& files, const std::function<void()>& poll) {
  MVS_CHECK(!words.empty(), "no program");
  const pid_t child = Start(words, files);
  int status = 0;
  Ending ending = Ending::kNotYet;
  while ((ending = TryAwait(child, &status)) == Ending::kNotYet) {
    try {
      if (poll) poll();
    } catch (...) {
      EndGroup(child);
      throw;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  if (ending == Ending::kUnknown)  // so when signals of ended children are ignored (SIGCHLD)
    throw IoError(words[0], "was started, but how it ended cannot be found out: somebody else has awaited it");
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

void AddChild(pid_t child, bool group) {
  const std::lock_guard<std::mutex> lock(All().mutex);
  CheckNotEnded(All());
  All().alive[child] = group;
}

void RemoveChild(pid_t child) {
  const std::lock_guard<std::mutex> lock(All().mutex);
  All().alive.erase(child);
}

void EndChildren() {
  const std::lock_guard<std::mutex> lock(All().mutex);
  All().ended = true;
  const std::map<pid_t, bool> children = All().alive;
  for (const auto& [child, group] : children) Signal(child, group, SIGTERM);
  std::map<pid_t, bool> left = children;
  WaitFor([&] {
    for (auto item = left.begin(); item != left.end();) {
      const bool ended = waitpid(item->first, nullptr, WNOHANG) != 0;
      item = ended && !(item->second && kill(-item->first, 0) == 0) ? left.erase(item) : std::next(item);
    }
    return left.empty();
  });
  for (const auto& [child, group] : left) Signal(child, group, SIGKILL);
  for (const auto& [child, group] : left) waitpid(child, nullptr, 0);
  All().alive.clear();
}

}  // namespace mvstudio
