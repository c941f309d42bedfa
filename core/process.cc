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
  if (!files.share_err && files.err.empty()) posix_spawn_file_actions_adddup2(actions, 1, 2);
  if (!files.share_err && !files.err.empty()) posix_spawn_file_actions_addopen(actions, 2, files.err.c_str(), mode, 0644);
  if (!files.folder.empty()) posix_spawn_file_actions_addchdir_np(actions, files.folder.c_str());
}

/// In a group of its own, Ctrl-C in a terminal is for the caller alone, who passes it on once. Signals that the caller ignores
/// or blocks are none of the program's business.
void SetSignals(ProcessGroup group, posix_spawnattr_t* attributes) {
  sigset_t none, usual;
  sigemptyset(&none);
  sigemptyset(&usual);
  for (const int number : {SIGPIPE, SIGXFSZ, SIGCHLD}) sigaddset(&usual, number);
  posix_spawnattr_setsigmask(attributes, &none);
  posix_spawnattr_setsigdefault(attributes, &usual);
  posix_spawnattr_setpgroup(attributes, 0);
  const int own = group == ProcessGroup::kOwn ? POSIX_SPAWN_SETPGROUP : 0;
  posix_spawnattr_setflags(attributes, static_cast<short>(own | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF));
}

void CheckNotEnded(const Children& children) {
  if (children.ended) throw CancelledError("interrupted");
}

pid_t Spawn(const std::vector<std::string>& words, const ProcessFiles& files, ProcessGroup group) {
  std::vector<char*> argv;
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  SpawnSetup setup;
  SetFiles(files, &setup.actions);
  SetSignals(group, &setup.attributes);
  const std::lock_guard<std::mutex> lock(All().mutex);
  CheckNotEnded(All());
  pid_t child = 0;
  const int error = posix_spawnp(&child, argv[0], &setup.actions, &setup.attributes, argv.data(), environ);
  if (error != 0) throw IoError(words[0], std::string("cannot be started: ") + std::strerror(error));
  All().alive[child] = group == ProcessGroup::kOwn;
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

/// Until `done` or the patience is over.
void WaitFor(const std::function<bool()>& done) {
  const auto end = Clock::now() + kPatience;
  while (!done() && Clock::now() <= end) std::this_thread::sleep_for(kStep);
}

/// Ends programs and the groups that they lead. `has_ended` awaits one that has ended; asked again, it stays true. A group
/// outlives its leader, so its number is still theirs.
void EndAll(const std::map<pid_t, bool>& children, const std::function<bool(pid_t)>& has_ended) {
  std::map<pid_t, bool> left = children;
  for (const auto& [child, group] : children) Signal(child, group, SIGTERM);
  WaitFor([&] {
    for (auto item = left.begin(); item != left.end();) {
      const auto [child, group] = *item;
      const bool gone = has_ended(child) && !(group && kill(-child, 0) == 0);
      item = gone ? left.erase(item) : std::next(item);
    }
    return left.empty();
  });
  for (const auto& [child, group] : left) Signal(child, group, SIGKILL);
  for (const auto& [child, group] : left) {
    while (!has_ended(child)) std::this_thread::sleep_for(kStep);
  }
}

}  // namespace

void Processes::Start(const std::vector<std::string>& words, const ProcessFiles& files) {
  MVS_CHECK(!words.empty(), "no program");
  children_.push_back({0, words[0]});
  try {
    children_.back().pid = Spawn(words, files, group_);
  } catch (...) {
    children_.pop_back();
    throw;
  }
}

bool Processes::AnyEnded() const {
  return std::any_of(children_.begin(), children_.end(), [](const Child& child) {
    if (child.exit) return true;
    siginfo_t ended = {};
    return waitid(P_PID, static_cast<id_t>(child.pid), &ended, WEXITED | WNOHANG | WNOWAIT) == 0 && ended.si_pid != 0;
  });
}

bool Processes::Collect() {
  bool all = true;
  for (Child& child : children_) {
    if (child.exit) continue;
    int status = 0;
    const Ending ending = TryAwait(child.pid, &status);
    if (ending == Ending::kNotYet) {
      all = false;
      continue;
    }
    child.exit = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    if (ending == Ending::kUnknown)  // so when signals of ended children are ignored (SIGCHLD)
      throw IoError(child.name, "was started, but how it ended cannot be found out: somebody else has awaited it");
  }
  return all;
}

std::vector<int> Processes::Wait(const std::function<void()>& poll) {
  const auto failed = [](const Child& child) { return child.exit && *child.exit != 0; };
  try {
    while (!Collect() && std::none_of(children_.begin(), children_.end(), failed)) {
      if (poll) poll();
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  } catch (...) {
    End();
    throw;
  }
  std::vector<int> exits;
  for (const Child& child : children_) exits.push_back(child.exit.value_or(kWasEnded));
  End();
  return exits;
}

void Processes::End() {
  std::map<pid_t, bool> left;
  for (const Child& child : children_) {
    if (!child.exit) left[child.pid] = group_ == ProcessGroup::kOwn;
  }
  children_.clear();
  EndAll(left, [](pid_t child) {
    int status = 0;
    return TryAwait(child, &status) != Ending::kNotYet;
  });
}

int RunProcess(const std::vector<std::string>& words, const ProcessFiles& files, const std::function<void()>& poll) {
  Processes one;
  one.Start(words, files);
  return one.Wait(poll).front();
}

void EndChildren() {
  const std::lock_guard<std::mutex> lock(All().mutex);
  All().ended = true;
  EndAll(All().alive, [](pid_t child) { return waitpid(child, nullptr, WNOHANG) != 0; });
  All().alive.clear();
}

}  // namespace mvstudio
