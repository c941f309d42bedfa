#include "core/disk/files.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <memory>
#include <thread>

#include "core/check.h"
#include "core/disk/lock.h"
#include "core/disk/new_folders.h"
#include "core/disk/output.h"
#include "core/disk/parents.h"
#include "core/disk/system_calls.h"
#include "core/disk/temporary.h"
#include "core/disk/trace.h"
#include "core/error.h"

namespace mvstudio {
namespace fs = std::filesystem;
namespace {

using internal::Allowed;
using internal::Descriptor;
using internal::ThrowErrno;

constexpr size_t kPieceBytes = 1 << 18;               // of one write
constexpr size_t kMostStreamBytes = size_t{1} << 30;  // read from a pipe
constexpr int kWaitsForWriter = 50;
constexpr int kPatienceMs = 10000;  // for the next byte of a pipe

std::atomic<IoFault> io_fault{nullptr};

void WriteAll(int fd, const std::string& path, std::string_view content) {
  while (!content.empty()) {
    if (!Allowed("write", path)) ThrowErrno(path, "cannot write", errno);
    const ssize_t written = write(fd, content.data(), std::min(content.size(), kPieceBytes));
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) ThrowErrno(path, "cannot write", errno);
    content.remove_prefix(static_cast<size_t>(written));
  }
}

void WriteAndClose(int fd, const std::string& path, std::string_view content) {
  try {
    WriteAll(fd, path, content);
  } catch (...) {
    close(fd);
    throw;
  }
  const bool allowed = Allowed("close", path);
  const int code = errno;
  if (close(fd) != 0 || !allowed) ThrowErrno(path, "cannot close", allowed ? errno : code);
}

std::string ReadRegular(int fd, const std::string& path, size_t told) {
  std::string content;
  for (;;) {  // files may grow
    const size_t have = content.size();
    content.resize(have < told ? told : have + kPieceBytes);
    const ssize_t got = read(fd, content.data() + have, content.size() - have);
    if (got < 0 && errno != EINTR) ThrowErrno(path, "cannot read", errno);
    content.resize(have + static_cast<size_t>(std::max<ssize_t>(got, 0)));
    if (got == 0) return content;
  }
}

/// What a pipe gives until its writer closes it; the descriptor does not block.
std::string ReadPipe(int fd, const std::string& path) {
  std::string content;
  std::string piece(kPieceBytes, '\0');
  int empty = 0;
  for (bool any = false;;) {
    const ssize_t got = read(fd, piece.data(), piece.size());
    if (got == 0 && !any) {  // somebody may be about to open its other end
      if (++empty > kWaitsForWriter) throw FormatError(path, "", "is a pipe that nobody writes to; a file was expected");
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      continue;
    }
    if (got == 0) return content;
    if (got > 0) {
      content.append(piece, 0, static_cast<size_t>(got)), any = true;
      if (content.size() > kMostStreamBytes)
        throw FormatError(path, "", "is a pipe that gives more than 1 GiB; save it as a file");
      continue;
    }
    if (errno != EAGAIN && errno != EINTR) ThrowErrno(path, "cannot read", errno);
    pollfd waiting{fd, POLLIN, 0};
    if (poll(&waiting, 1, kPatienceMs) == 0)
      throw FormatError(path, "", "is a pipe that gave nothing for 10 s; save it as a file");
    any = true;  // there is a writer, even if it has nothing to say
  }
}

void RequireOurRoom(const std::string& path) {
  MVS_CHECK(internal::IsTemporaryHere(path) || internal::InWorkFolder(path),
            path << " is neither a temporary file nor in a work folder");
}

/// In the kernel where it can be done: file systems that share blocks copy nothing.
void CopyContent(int from_fd, int to_fd, const std::string& from, const std::string& to) {
  std::string piece(kPieceBytes, '\0');
  for (bool in_kernel = true;;) {
    if (in_kernel) {
      if (!Allowed("write", to)) ThrowErrno(to, "cannot write", errno);
      const ssize_t copied = copy_file_range(from_fd, nullptr, to_fd, nullptr, size_t{1} << 30, 0);
      if (copied > 0 || (copied < 0 && errno == EINTR)) continue;
      if (copied < 0 && (errno == ENOSPC || errno == EDQUOT || errno == EIO)) ThrowErrno(to, "cannot write", errno);
      in_kernel = false;  // the end, or a file system that cannot: reading tells
    }
    const ssize_t got = read(from_fd, piece.data(), piece.size());
    if (got == 0) return;
    if (got < 0 && errno != EINTR) ThrowErrno(from, "cannot read", errno);
    WriteAll(to_fd, to, std::string_view(piece).substr(0, static_cast<size_t>(std::max<ssize_t>(got, 0))));
  }
}

/// Two processes that append wait for each other.
std::unique_ptr<FileLock> LockForAppending(const std::string& path) {
  if (internal::InWorkFolder(path)) return nullptr;
  MakeFolder(internal::ParentOf(path));
  constexpr int kTries = 500;
  for (int i = 0;; ++i) {
    auto lock = std::make_unique<FileLock>(internal::LockPathOf(path), path);
    if (lock->owned()) return lock;
    if (i == kTries) throw LockedError(path + ": is being written by " + lock->owner() + "; try again");
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

}  // namespace

namespace internal {

Descriptor::~Descriptor() {
  if (fd >= 0) close(fd);
}

int Descriptor::Release() {
  const int mine = fd;
  fd = -1;
  return mine;
}

bool Allowed(const char* operation, const std::string& path) {
  const IoFault fault = io_fault.load();
  const int code = fault ? fault(operation, path) : 0;
  if (code) errno = code;
  return code == 0;
}

void ThrowErrno(const std::string& path, const std::string& action, int code) {
  const std::string text = action + ": " + std::strerror(code);
  if (code == ENOSPC || code == EDQUOT || code == EFBIG) {
    throw ResourceError(path + ": " + text + "; free some space or choose another option 'out'");
  }
  if (code == ENOMEM || code == EMFILE || code == ENFILE) throw ResourceError(path + ": " + text);
  throw IoError(path, text);
}

std::string ParentOf(const std::string& path) {
  const std::string parent = fs::path(path).parent_path().string();
  return parent.empty() ? "." : parent;
}

std::vector<std::string> MakeParents(const std::string& path) {
  std::vector<std::string> made;
  for (std::string folder = ParentOf(path); !Exists(folder) && folder != "."; folder = ParentOf(folder))
    made.insert(made.begin(), folder);
  MakeFolder(ParentOf(path));
  return made;
}

void RemoveEmpty(const std::vector<std::string>& folders) {
  for (auto folder = folders.rbegin(); folder != folders.rend(); ++folder) rmdir(folder->c_str());
}

bool Exists(const std::string& path) {
  struct stat info {};
  return lstat(path.c_str(), &info) == 0;
}

}  // namespace internal

std::string ReadFile(const std::string& path) {
  const Descriptor file(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  struct stat info {};
  if (file.fd < 0 || fstat(file.fd, &info) != 0) ThrowErrno(path, "cannot open", errno);
  if (S_ISDIR(info.st_mode)) throw IoError(path, "is a folder, a file was expected");
  TraceRead(path);
  if (S_ISFIFO(info.st_mode)) return ReadPipe(file.fd, path);
  if (!S_ISREG(info.st_mode)) throw FormatError(path, "", "is a device or a socket; a file was expected");
  return ReadRegular(file.fd, path, static_cast<size_t>(std::max<off_t>(info.st_size, 0)));
}

void FlushToDisk(const std::string& path) {
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) ThrowErrno(path, "cannot reopen to flush", errno);
  const bool failed = !Allowed("flush", path) || fsync(fd) != 0;
  const int code = errno;
  close(fd);
  // Folders on some file systems cannot be flushed; that is not a loss of data.
  if (failed && code != EINVAL) ThrowErrno(path, "cannot flush", code);
}

void WriteFile(const std::string& path, std::string_view content) {
  RequireOurRoom(path);
  const bool temporary = internal::IsTemporaryHere(path);
  // What is there in a work folder may be a link to somebody else's file, so it is never written into.
  if (!temporary && unlink(path.c_str()) != 0 && errno != ENOENT && errno != ENOTDIR) ThrowErrno(path, "cannot replace", errno);
  const int flags = O_WRONLY | O_NOFOLLOW | O_CLOEXEC | (temporary ? O_TRUNC : O_CREAT | O_EXCL);
  const int fd = Allowed("create", path) ? open(path.c_str(), flags, 0666) : -1;
  if (fd < 0) ThrowErrno(path, "cannot create", errno);
  WriteAndClose(fd, path, content);
}

void CopyFile(const std::string& from, const std::string& to) {
  RequireOurRoom(to);
  const Descriptor source(open(from.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat info {};
  if (source.fd < 0 || fstat(source.fd, &info) != 0) ThrowErrno(from, "cannot open", errno);
  if (!S_ISREG(info.st_mode)) throw FormatError(from, "", "is no file");
  Descriptor target(Allowed("create", to) ? open(to.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666) : -1);
  if (target.fd < 0) ThrowErrno(to, "cannot create", errno);
  CopyContent(source.fd, target.fd, from, to);
}

bool HardLink(const std::string& from, const std::string& to) {
  RequireOurRoom(to);
  if (!Allowed("create", to)) ThrowErrno(to, "cannot create", errno);
  if (link(from.c_str(), to.c_str()) == 0) return true;
  if (errno == EXDEV || errno == EPERM || errno == EMLINK || errno == EOPNOTSUPP || errno == EACCES) return false;
  ThrowErrno(to, "cannot link", errno);
}

void MakeSymbolicLink(const std::string& target, const std::string& path) {
  RequireOurRoom(path);
  if (!Allowed("create", path) || symlink(target.c_str(), path.c_str()) != 0) ThrowErrno(path, "cannot make the link", errno);
}

void RemoveFromWork(const std::string& path) {
  MVS_CHECK(internal::InWorkFolder(path), path << " is not in a work folder");
  std::error_code error;
  if (Allowed("remove", path)) fs::remove_all(path, error);
  if (error) ThrowErrno(path, "cannot remove", error.value());
}

void AppendToFile(const std::string& path, std::string_view content) {
  RequireOurRoom(path);
  const int fd = open(path.c_str(), O_WRONLY | O_APPEND | O_NOFOLLOW | O_CLOEXEC);
  if (fd < 0) ThrowErrno(path, "cannot open to append", errno);
  WriteAndClose(fd, path, content);
}

void MakePrivate(const std::string& path) {
  RequireOurRoom(path);
  if (chmod(path.c_str(), S_IRUSR | S_IWUSR) != 0) ThrowErrno(path, "cannot make it the user's alone", errno);
}

void WriteFileAtomic(const std::string& path, std::string_view content) {
  WriteFileAtomic(path, [&](const std::string& temporary) { WriteFile(temporary, content); });
}

void WriteFileAtomic(const std::string& path, const std::function<void(const std::string&)>& write) {
  auto file = std::make_unique<AtomicFile>(path);
  write(file->temporary());
  FilesTogether::TakeOrCommit(std::move(file));
}

IoFault SetIoFault(IoFault fault) { return io_fault.exchange(fault); }

void AppendLine(const std::string& path, std::string_view line) {
  const std::unique_ptr<FileLock> lock = LockForAppending(path);
  std::string content = internal::Exists(path) ? ReadFile(path) : "";
  if (!content.empty() && content.back() != '\n') content += '\n';
  WriteFileAtomic(path, content.append(line) + '\n');
}

void MakeFolder(const std::string& path) {
  std::error_code code;
  if (!Allowed("folder", path)) ThrowErrno(path, "cannot create folder", errno);
  fs::create_directories(internal::OneName(path), code);
  if (code) ThrowErrno(path, "cannot create folder", code.value());
}

NewFolders::~NewFolders() { internal::RemoveEmpty(made_); }

void NewFolders::Make(const std::string& given) {
  const std::string path = internal::OneName(given);
  const bool is_new = !internal::Exists(path);
  const std::vector<std::string> parents = internal::MakeParents(path);
  made_.insert(made_.end(), parents.begin(), parents.end());
  MakeFolder(path);
  if (is_new) made_.push_back(path);
}

void NewFolders::Keep() { made_.clear(); }

}  // namespace mvstudio
