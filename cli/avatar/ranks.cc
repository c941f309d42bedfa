#include "cli/avatar/ranks.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>

#include "cli/program/options.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/process.h"

extern char** environ;

namespace mvstudio::cli {
namespace {

/// `words` without each of `flags` and its value.
std::vector<std::string> Without(const std::vector<std::string>& words, const std::vector<std::string>& flags) {
  std::vector<std::string> rest;
  for (size_t i = 0; i < words.size(); ++i) {
    const std::string name = words[i].substr(0, words[i].find('='));
    if (std::find(flags.begin(), flags.end(), name) == flags.end()) {
      rest.push_back(words[i]);
    } else if (name == words[i]) {
      ++i;
    }
  }
  return rest;
}

/// Starts this program again with its standard output closed: only the first rank reports.
pid_t Start(std::vector<std::string> words) {
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int error = posix_spawn(&child, "/proc/self/exe", &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw ResourceError(std::string("cannot start another rank: ") + std::strerror(error));
  return child;
}

}  // namespace

void AddRankOptions(CLI::App* sub, RankArguments& a) {
  AddOption(sub, "--ranks", a.ranks,
            "processes on this machine that take --batch images each and share their gradients; as one process with a "
            "batch as many times as large")
      ->capture_default_str();
  AddOption(sub, "--rank", a.rank, "which process this is, from 0, when you start them yourself (several machines)")
      ->capture_default_str();
  AddOption(sub, "--world-size", a.world_size, "how many processes you start")->capture_default_str();
  AddOption(sub, "--rendezvous", a.rendezvous, "a new file that all of them can see");
}

RankProcesses::RankProcesses(const RankArguments& a, const CommandContext& context, const std::string& folder)
    : progress_(context.run.progress), threads_(context.run.num_threads) {
  if (a.ranks < 1 || a.ranks > 256 || a.world_size < 1) throw UsageError("--ranks and --world-size must be at least 1");
  if (a.ranks > 1 && (a.world_size > 1 || a.rank > 0 || !a.rendezvous.empty()))
    throw UsageError("--ranks starts the processes itself: leave --rank, --world-size and --rendezvous out");
  place_ = {a.rank, a.world_size, a.rendezvous, false, {}};
  if (a.ranks == 1) {
    if (a.world_size == 1 && a.rank != 0) throw UsageError("--rank " + std::to_string(a.rank) + " needs --world-size");
    place_.one_machine = a.rendezvous.rfind("local:", 0) == 0;
    if (place_.one_machine) place_.rendezvous = a.rendezvous.substr(6);
    return;
  }
  meeting_ = std::make_unique<ScratchFolder>(folder);
  place_ = {0, a.ranks, meeting_->path() + "/ranks", true, {}};
  threads_ = std::max(1, ResolveThreads(context.run.num_threads) / a.ranks);
  const std::vector<std::string> words = Without(context.argv, {"--ranks", "--threads", "--progress"});
  try {
    StartOthers(words, a.ranks);
  } catch (...) {
    EndOthers();
    throw;
  }
}

void RankProcesses::StartOthers(const std::vector<std::string>& words, int ranks) {
  for (int rank = 1; rank < ranks; ++rank) {
    std::vector<std::string> child = words;
    for (const std::string& word :
         {std::string("--rank"), std::to_string(rank), std::string("--world-size"), std::to_string(ranks),
          std::string("--rendezvous"), "local:" + place_.rendezvous, std::string("--threads"), std::to_string(threads_),
          std::string("--progress"), std::string("none")})
      child.push_back(word);
    children_.push_back(Start(child));
    AddChild(children_.back(), false);
  }
}

void RankProcesses::EndOthers() {
  for (const pid_t child : children_) kill(child, SIGTERM);
  for (const pid_t child : children_) {
    waitpid(child, nullptr, 0);
    RemoveChild(child);
  }
  children_.clear();
}

RankProcesses::~RankProcesses() { EndOthers(); }

std::shared_ptr<const avatar::Ranks> RankProcesses::Join() const {
  if (place_.size == 1) return nullptr;
  avatar::RankPlace place = place_;
  place.while_waiting = [this] {
    if (progress_ && progress_->Cancelled()) throw CancelledError("interrupted before the other ranks were there");
    for (const pid_t child : children_) {
      siginfo_t ended = {};
      if (waitid(P_PID, static_cast<id_t>(child), &ended, WEXITED | WNOHANG | WNOWAIT) == 0 && ended.si_pid != 0)
        throw IoError("--ranks", "another rank ended before training began; see its message above");
    }
  };
  return avatar::JoinRanks(place);
}

void RankProcesses::Finish() {
  int failed = 0;
  for (const pid_t child : children_) {
    int status = 0;
    waitpid(child, &status, 0);
    RemoveChild(child);
    failed += !WIFEXITED(status) || WEXITSTATUS(status) != 0;
  }
  children_.clear();
  if (failed > 0)
    throw IoError("--ranks", std::to_string(failed) + " of the other ranks did not end well; see their messages above");
}

}  // namespace mvstudio::cli
