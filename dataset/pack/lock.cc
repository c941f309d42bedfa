#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <ctime>

#include "core/error.h"
#include "dataset/pack/lock_internal.h"

namespace mvstudio::dataset::internal {
namespace {

std::string Myself() {
  char host[256] = "";
  gethostname(host, sizeof(host) - 1);
  char time_text[32];
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::strftime(time_text, sizeof(time_text), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return "process " + std::to_string(getpid()) + " on " + host + ", since " + time_text;
}

std::string ReadOwner(int fd) {
  char text[512];
  const ssize_t count = pread(fd, text, sizeof(text), 0);
  return count > 0 ? std::string(text, static_cast<size_t>(count)) : "another process";
}

}  // namespace

FileLock::FileLock(const std::string& path) : path_(path) {
  // Whoever had the file may remove it between our opening and locking it: then we hold a file without a name and try again.
  while (!TryOnce()) {
  }
}

bool FileLock::TryOnce() {
  const int fd = open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (fd < 0) {
    if (errno == ENOSPC || errno == EDQUOT) throw ResourceError(path_ + ": no space left for a lock file; free some space");
    throw IoError(path_, std::string("cannot make the lock file: ") + std::strerror(errno));
  }
  if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
    owner_ = ReadOwner(fd);
    close(fd);
    return true;
  }
  struct stat mine {
  }, named{};
  if (fstat(fd, &mine) != 0 || stat(path_.c_str(), &named) != 0 || mine.st_ino != named.st_ino) {
    close(fd);
    return false;
  }
  fd_ = fd;
  const std::string text = Myself();
  // Only for messages: a full disk does not matter here.
  if (ftruncate(fd, 0) == 0 && pwrite(fd, text.data(), text.size(), 0) < 0) errno = 0;
  return true;
}

FileLock::~FileLock() {
  if (fd_ < 0) return;
  unlink(path_.c_str());
  close(fd_);
}

}  // namespace mvstudio::dataset::internal
