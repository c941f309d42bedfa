#include "core/files.h"

#include <fcntl.h>
#include <glob.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "core/error.h"

namespace mvstudio {
namespace fs = std::filesystem;
namespace {

constexpr size_t kPieceBytes = 1 << 18;               // of one write
constexpr size_t kMostStreamBytes = size_t{1} << 30;  // read from a pipe or a device

struct Descriptor {
  explicit Descriptor(int fd_) : fd(fd_) {}
  ~Descriptor() {
    if (fd >= 0) close(fd);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  const int fd;
};

std::atomic<IoFault> io_fault{nullptr};

// True when the step is to go ahead; otherwise errno says why not.
bool Allowed(const char* operation, const std::string& path) {
  const IoFault fault = io_fault.load();
  const int code = fault ? fault(operation, path) : 0;
  if (code) errno = code;
  return code == 0;
}

[[noreturn]] void ThrowErrno(const std::string& path, const std::string& action, int code) {
  const std::string text = action + ": " + std::strerror(code);
  if (code == ENOSPC || code == EDQUOT || code == EFBIG) {
    throw ResourceError(path + ": " + text + "; free some space or choose another --out");
  }
  throw IoError(path, text);
}

void WriteAll(int fd, const std::string& path, std::string_view content) {
  while (!content.empty()) {
    if (!Allowed("write", path)) ThrowErrno(path, "cannot write", errno);
    const ssize_t written = write(fd, content.data(), std::min(content.size(), kPieceBytes));
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) ThrowErrno(path, "cannot write", errno);
    content.remove_prefix(static_cast<size_t>(written));
  }
}

void Rename(const std::string& from, const std::string& to) {
  if (!Allowed("rename", to) || rename(from.c_str(), to.c_str()) != 0) ThrowErrno(to, "cannot rename into place", errno);
}

void MoveFolder(const std::string& from, const std::string& to, std::error_code& code) {
  if (Allowed("rename", to)) {
    fs::rename(from, to, code);
  } else {
    code.assign(errno, std::generic_category());
  }
}

std::string TemporaryBeside(const fs::path& path) {
  return (path.parent_path() / ("." + path.stem().string() + ".tmp-" + std::to_string(getpid()) + path.extension().string()))
      .string();
}

void MakeParent(const std::string& path) {
  const fs::path parent = fs::path(path).parent_path();
  if (!parent.empty()) MakeFolder(parent.string());
}

}  // namespace

std::string ReadFile(const std::string& path) {
  if (fs::is_directory(path)) throw IoError(path, "is a folder, a file was expected");
  const Descriptor file(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat info {};
  if (file.fd < 0 || fstat(file.fd, &info) != 0) ThrowErrno(path, "cannot open", errno);
  const size_t told = static_cast<size_t>(std::max<off_t>(info.st_size, 0));
  std::string content;
  for (;;) {  // pipes and devices tell no size, files may grow
    const size_t have = content.size();
    content.resize(have < told ? told : have + kPieceBytes);
    const ssize_t got = read(file.fd, content.data() + have, content.size() - have);
    if (got < 0 && errno != EINTR) ThrowErrno(path, "cannot read", errno);
    content.resize(have + static_cast<size_t>(std::max<ssize_t>(got, 0)));
    if (got == 0) return content;
    if (!S_ISREG(info.st_mode) && content.size() > kMostStreamBytes)
      throw FormatError(path, "", "gives more than 1 GiB and is no regular file: is it a device?");
  }
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

void RemoveFile(const std::string& path) {
  if ((!Allowed("remove", path) || unlink(path.c_str()) != 0) && errno != ENOENT) ThrowErrno(path, "cannot remove", errno);
}

void WriteFile(const std::string& path, std::string_view content) {
  const int fd = Allowed("create", path) ? open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644) : -1;
  if (fd < 0) ThrowErrno(path, "cannot create", errno);
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

void WriteFileAtomic(const std::string& path, std::string_view content) {
  WriteFileAtomic(path, [&](const std::string& temporary) { WriteFile(temporary, content); });
}

void WriteFileAtomic(const std::string& path, const std::function<void(const std::string&)>& write) {
  MakeParent(path);
  const std::string temporary = TemporaryBeside(path);
  try {
    write(temporary);
    FlushToDisk(temporary);
    Rename(temporary, path);
  } catch (...) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    throw;
  }
}

IoFault SetIoFault(IoFault fault) { return io_fault.exchange(fault); }

void AppendLine(const std::string& path, std::string_view line) {
  MakeParent(path);
  const int fd = open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (fd < 0) ThrowErrno(path, "cannot open to append", errno);
  try {
    WriteAll(fd, path, std::string(line) + "\n");
  } catch (...) {
    close(fd);
    throw;
  }
  close(fd);
}

void MakeFolder(const std::string& path) {
  std::error_code code;
  if (!Allowed("folder", path)) ThrowErrno(path, "cannot create folder", errno);
  fs::create_directories(path, code);
  if (code) ThrowErrno(path, "cannot create folder", code.value());
}

std::vector<std::string> Glob(const std::string& pattern) {
  const std::string expanded = fs::is_directory(pattern) ? pattern + "/*" : pattern;
  glob_t found{};
  std::vector<std::string> paths;
  if (glob(expanded.c_str(), 0, nullptr, &found) == 0) {
    for (size_t i = 0; i < found.gl_pathc; ++i) paths.emplace_back(found.gl_pathv[i]);
  }
  globfree(&found);
  if (fs::is_directory(pattern)) {
    paths.erase(std::remove_if(paths.begin(), paths.end(), [](const std::string& p) { return !fs::is_regular_file(p); }),
                paths.end());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

AtomicFolder::AtomicFolder(const std::string& path, bool overwrite) : path_(fs::path(path).lexically_normal().string()) {
  while (path_.size() > 1 && path_.back() == '/') path_.pop_back();
  if (fs::exists(path_) && !overwrite && !fs::is_empty(path_)) {
    throw UsageError(path_ + ": exists already; choose another --out or pass --overwrite");
  }
  const fs::path target(path_);
  work_path_ = (target.parent_path() / ("." + target.filename().string() + ".tmp-" + std::to_string(getpid()))).string();
  std::error_code ignored;
  fs::remove_all(work_path_, ignored);
  MakeFolder(work_path_);
}

AtomicFolder::~AtomicFolder() {
  std::error_code ignored;
  if (!committed_) fs::remove_all(work_path_, ignored);
}

void AtomicFolder::Commit() {
  std::error_code code;
  const std::string old = work_path_ + ".old";
  const bool had_old = fs::exists(path_);
  if (had_old) MoveFolder(path_, old, code);
  if (code) ThrowErrno(path_, "cannot move the old folder away", code.value());
  MoveFolder(work_path_, path_, code);
  if (code) {
    std::error_code ignored;
    if (had_old) fs::rename(old, path_, ignored);
    ThrowErrno(path_, "cannot rename into place", code.value());
  }
  committed_ = true;
  if (had_old) fs::remove_all(old, code);
}

}  // namespace mvstudio
