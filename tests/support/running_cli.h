#pragma once

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <thread>

#include "tests/support/run_cli.h"

/// The program under test while it runs.
namespace mvstudio::testing {

inline constexpr std::chrono::seconds kBound(8);  // the contract's five, and a busy machine

/// A program that was started and not awaited yet; killed at the end of a test that failed.
class Running {
 public:
  Running(const std::vector<std::string>& words, const TempDir& folder, const std::function<void()>& setup = {})
      : out_(folder / "stdout"), err_(folder / "stderr") {
    pid_ = fork();
    if (pid_ != 0) return;
    if (setup) setup();
    std::vector<char*> argv = {const_cast<char*>("mvstudio")};
    for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
    argv.push_back(nullptr);
    dup2(open(out_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644), STDOUT_FILENO);
    dup2(open(err_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644), STDERR_FILENO);
    execv(CliPath().c_str(), argv.data());
    _exit(99);
  }
  ~Running() {
    if (pid_ > 0) kill(pid_, SIGKILL), waitpid(pid_, nullptr, 0);
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  /// True once it handles signals itself: before that, nothing has begun.
  bool Listens() const {
    std::ifstream in("/proc/" + std::to_string(pid_) + "/status");
    for (std::string word; in >> word;) {
      if (word != "SigCgt:") continue;
      uint64_t caught = 0;
      in >> std::hex >> caught;
      return caught >> (SIGTERM - 1) & 1;
    }
    return false;
  }
  std::string Pid() const { return std::to_string(pid_); }
  void Send(int number) const { kill(pid_, number); }
  bool HasEnded() { return pid_ < 0 || Await(std::chrono::seconds(0)); }
  /// False when it still runs after `limit`.
  bool Await(std::chrono::milliseconds limit) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (pid_ > 0) {
      if (waitpid(pid_, &status_, WNOHANG) == pid_) {
        pid_ = -1;
        break;
      }
      if (std::chrono::steady_clock::now() > end) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return true;
  }
  CliRun Result() const { return {WIFEXITED(status_) ? WEXITSTATUS(status_) : -1, Slurp(out_), Slurp(err_)}; }

 private:
  std::string out_, err_;
  pid_t pid_ = -1;
  int status_ = 0;
};

inline bool WaitUntil(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

/// Whether a process does anything any more; one that has ended and is not awaited yet does not.
inline bool Runs(const std::string& pid) {
  std::ifstream in("/proc/" + pid + "/stat");
  std::string number, name, state;
  return static_cast<bool>(in >> number >> name >> state) && state != "Z";
}

}  // namespace mvstudio::testing
