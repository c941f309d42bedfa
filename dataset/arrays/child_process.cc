#include "dataset/arrays/child_process.h"

#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <new>

#include "core/disk/lock.h"
#include "core/error.h"
#include "dataset/arrays/hdf5_handle.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr size_t kMaxAnswerBytes = 64 << 20;

// Kind, then the parts of the error or the text, each ended by a zero byte.
std::string Answer(char kind, const std::string& a, const std::string& b = "", const std::string& c = "") {
  std::string text(1, kind);
  for (const std::string* part : {&a, &b, &c}) text.append(part->c_str()).push_back('\0');
  return text;
}

std::string Work(const std::function<std::string()>& work) {
  try {
    return "T" + work();
  } catch (const FormatError& error) {
    const size_t skip = error.path().size() + (error.where().empty() ? 0 : error.where().size() + 2) + 2;
    return Answer('F', error.path(), error.where(), std::string(error.what()).substr(skip));
  } catch (const IoError& error) {
    return Answer('I', error.path(), std::string(error.what()).substr(error.path().size() + 2));
  } catch (const ResourceError& error) {
    return Answer('R', error.what());
  } catch (const UsageError& error) {
    return Answer('U', error.what());
  } catch (const LockedError& error) {
    return Answer('L', error.what());
  } catch (const std::bad_alloc&) {
    return "M";
  } catch (const std::exception& error) {
    return Answer('E', error.what());
  }
}

[[noreturn]] void ThrowAnswer(const std::string& path, const std::string& answer) {
  std::string parts[3];
  size_t at = 1;
  for (std::string& part : parts) {
    part = answer.c_str() + std::min(at, answer.size());
    at += part.size() + 1;
  }
  switch (answer[0]) {
    case 'F':
      throw FormatError(parts[0], parts[1], parts[2]);
    case 'I':
      throw IoError(parts[0], parts[1]);
    case 'R':
      throw ResourceError(parts[0]);
    case 'U':
      throw UsageError(parts[0]);
    case 'L':
      throw LockedError(parts[0]);
    case 'M':
      throw FormatError(path, "", "takes more memory than its size allows; refused");
    default:
      throw FormatError(path, "", "cannot be read: " + parts[0]);
  }
}

// Address space of this process, bytes.
uint64_t AddressSpace() {
  std::ifstream in("/proc/self/statm");
  uint64_t pages = 0;
  in >> pages;
  return pages * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

void Limit(int resource, uint64_t value) {
  rlimit limit{};
  getrlimit(static_cast<__rlimit_resource_t>(resource), &limit);
  limit.rlim_cur = std::min<rlim_t>(value, limit.rlim_max);
  setrlimit(static_cast<__rlimit_resource_t>(resource), &limit);
}

/// The system ends this process with `parent`, or rather with its thread that waits for the answer.
void EndWith(pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(1);  // it was gone before
}

[[noreturn]] void RunChild(int pipe_fd, const ChildLimits& limits, const std::function<std::string()>& work) {
  for (const int signal_number : {SIGINT, SIGTERM, SIGHUP, SIGPIPE, SIGSEGV, SIGABRT, SIGBUS, SIGFPE})
    signal(signal_number, SIG_DFL);
  Limit(RLIMIT_CORE, 0);
  Limit(RLIMIT_AS, AddressSpace() + limits.max_memory_bytes);
  Limit(RLIMIT_CPU, static_cast<uint64_t>(std::ceil(limits.deadline_s)) + 1);
  const std::string answer = Work(work);
  size_t at = 0;
  while (at < answer.size()) {
    const ssize_t written = write(pipe_fd, answer.data() + at, answer.size() - at);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) _exit(1);
    at += static_cast<size_t>(written);
  }
  _exit(0);
}

// Reads until the pipe is closed; false when the deadline passed or the answer is absurdly long.
bool ReadAnswer(int fd, double deadline_s, std::string* answer) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(deadline_s));
  char piece[1 << 16];
  while (answer->size() <= kMaxAnswerBytes) {
    const auto left_ms = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now()).count();
    if (left_ms <= 0) return false;
    pollfd waiting = {fd, POLLIN, 0};
    if (poll(&waiting, 1, static_cast<int>(std::min<int64_t>(left_ms, 1000))) <= 0) continue;
    const ssize_t count = read(fd, piece, sizeof(piece));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return count == 0;
    answer->append(piece, static_cast<size_t>(count));
  }
  return false;
}

int WaitFor(pid_t child) {
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

}  // namespace

std::string RunInChild(const std::string& path, const ChildLimits& limits, const std::function<std::string()>& work) {
  int ends[2];
  if (pipe(ends) != 0) throw ResourceError("cannot make a pipe to check " + path + ": " + std::strerror(errno));
  const pid_t parent = getpid();
  pid_t child = -1;
  {
    // The child gets HDF5 in a state in which nobody else is using it.
    const auto lock = LockHdf5();
    child = fork();
    if (child == 0) {
      EndWith(parent);
      RenewHdf5LockInChild();
      close(ends[0]);
      RunChild(ends[1], limits, work);
    }
  }
  const int code = errno;
  close(ends[1]);
  if (child < 0) {
    close(ends[0]);
    throw ResourceError("cannot start a process to check " + path + ": " + std::strerror(code));
  }
  std::string answer;
  const bool in_time = ReadAnswer(ends[0], limits.deadline_s, &answer);
  close(ends[0]);
  if (!in_time) kill(child, SIGKILL);
  const int status = WaitFor(child);
  if (!in_time) throw FormatError(path, "", "reading it did not end in time: damaged or made to harm; refused");
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 || answer.empty()) {
    throw FormatError(path, "", "reading it brings the HDF5 library down: damaged or made to harm; refused");
  }
  if (answer[0] != 'T') ThrowAnswer(path, answer);
  return answer.substr(1);
}

}  // namespace mvstudio::dataset::internal
