#include "cli/program/interrupt.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/time.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <new>
#include <system_error>
#include <thread>

#include "cli/program/result.h"
#include "core/disk/temporary.h"
#include "core/process.h"

namespace mvstudio::cli {
namespace {

constexpr int kPatienceMs = 3200;              // of the watcher with the command
constexpr suseconds_t kLastStepsUs = 1700000;  // then; more is not waited for, whatever hangs

std::atomic<int> received_signal{0};
std::atomic<int> last_exit{0};
std::atomic<bool> output_claimed{false};
std::atomic<const LastWords*> spoken_last{nullptr};  // never freed
std::atomic<int> wake_fd{-1};                        // write end of a pipe to the watcher; -1: there is none
pid_t own_pid = 0;

void OnSignal(int number) {
  if (getpid() != own_pid) _exit(128 + number);  // in a copy of this process nobody watches
  const int code = errno;
  int none = 0;
  const bool first = received_signal.compare_exchange_strong(none, number);
  const int fd = wake_fd;
  if (fd < 0 && !first) _exit(128 + received_signal);
  if (fd >= 0) (void)!write(fd, "", 1);
  errno = code;
}

/// Asks the command to stop, however long it takes.
void OnGentleSignal(int number) {
  if (getpid() != own_pid) return;
  int none = 0;
  received_signal.compare_exchange_strong(none, number);
}

void ExitNow(int) { _exit(last_exit); }

void Handle(int number, void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART;
  sigaction(number, &action, nullptr);
}

bool IsIgnored(int number) {
  struct sigaction action {};
  return sigaction(number, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

/// True when a signal came in time; `timeout_ms` -1: however long it takes.
bool AwaitSignal(int fd, int timeout_ms) {
  pollfd waiting = {fd, POLLIN, 0};
  int ready = 0;
  while ((ready = poll(&waiting, 1, timeout_ms)) < 0 && errno == EINTR) {
  }
  char byte = 0;
  return ready > 0 && read(fd, &byte, 1) == 1;
}

[[noreturn]] void EndProcess(const CommandResult& outcome) {
  last_exit = outcome.exit;
  Handle(SIGALRM, ExitNow);
  const itimerval limit = {{0, 0}, {kLastStepsUs / 1000000, kLastStepsUs % 1000000}};
  setitimer(ITIMER_REAL, &limit, nullptr);
  if (!output_claimed.exchange(true)) {
    EndChildren();
    AbandonTemporaries();
    (*spoken_last)(outcome);
  } else {
    std::this_thread::sleep_for(std::chrono::seconds(1));  // the command has ended and is being reported
  }
  _exit(outcome.exit);
}

/// Nothing but this can be done where there is no memory.
[[noreturn]] void EndAtOnce() {
  constexpr char kText[] = "error: out of memory\n";
  (void)!write(STDERR_FILENO, kText, sizeof kText - 1);
  _exit(kExitResources);
}

[[noreturn]] void EndUncaught() {
  try {
    if (std::current_exception()) throw;
  } catch (const std::bad_alloc&) {
    if (!spoken_last) EndAtOnce();
    try {
      EndProcess(ResultOfCurrentException());
    } catch (...) {
      EndAtOnce();
    }
  } catch (...) {
  }
  __gnu_cxx::__verbose_terminate_handler();  // as without this handler: it says what was thrown
  std::abort();
}

/// Before libraries are initialised: libtorch alone takes some hundred megabytes then.
void CatchEarly() { std::set_terminate(EndUncaught); }
__attribute__((section(".preinit_array"), used)) void (*const catch_early)() = CatchEarly;

void Watch(int fd) {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  AwaitSignal(fd, -1);
  AwaitSignal(fd, kPatienceMs);
  EndProcess(InterruptedResult(received_signal));
}

/// Without a watcher (no descriptors or no threads left) a second signal ends the process at once.
void StartWatcher() {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return;
  fcntl(ends[1], F_SETFL, O_NONBLOCK);
  try {
    std::thread(Watch, ends[0]).detach();
    wake_fd = ends[1];
  } catch (const std::system_error&) {
    close(ends[0]);
    close(ends[1]);
  }
}

/// The process MVSTUDIO_CALLER waits for this one: when it is gone, however it ended, this one is asked to end. To the system
/// that is the thread that started this one, which therefore has to be the one that waits.
void EndWithCaller() {
  const char* caller = std::getenv("MVSTUDIO_CALLER");
  if (!caller || std::to_string(getppid()) != caller) return;  // not set, or set for who has called this one in turn
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (std::to_string(getppid()) != caller) std::raise(SIGTERM);  // it was gone before
}

}  // namespace

void PrepareProcess() {
  for (int fd = 0; fd <= 2; ++fd) {
    if (fcntl(fd, F_GETFD) >= 0) continue;
    open("/dev/null", fd == STDERR_FILENO ? O_WRONLY : O_RDONLY);  // takes that number; writing to a stdout like this fails
  }
  std::signal(SIGCHLD, SIG_DFL);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a file beyond the limit is then an error like a full disk, and nothing is left behind
  sigset_t heard;
  sigemptyset(&heard);
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGUSR1, SIGALRM, SIGCHLD}) sigaddset(&heard, number);
  sigprocmask(SIG_UNBLOCK, &heard, nullptr);
  EndWithCaller();
}

void InstallSignalHandlers(const LastWords& last_words) {
  own_pid = getpid();
  spoken_last = new LastWords(last_words);
  StartWatcher();
  Handle(SIGINT, OnSignal);
  Handle(SIGTERM, OnSignal);
  if (!IsIgnored(SIGHUP)) Handle(SIGHUP, OnSignal);
  if (!IsIgnored(SIGUSR1)) Handle(SIGUSR1, OnGentleSignal);
}

int ReceivedSignal() { return received_signal; }

void ClaimOutput() {
  while (output_claimed.exchange(true)) pause();
}

}  // namespace mvstudio::cli
