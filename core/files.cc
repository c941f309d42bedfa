#include "core/files.h"

#include <fcntl.h>
#include <glob.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "core/error.h"

namespace mvstudio {
namespace fs = std::filesystem;
namespace {

[[noreturn]] void ThrowErrno(const std::string& path, const std::string& action, int code) {
  const std::string text = action + ": " + std::strerror(code);
  if (code == ENOSPC || code == EDQUOT) {
    throw ResourceError(path + ": " + text + "; free some space or choose another --out");
  }
  throw IoError(path, text);
}

void FlushToDisk(const std::string& path) {
  const int fd = open(path.c_str(), O_RDONLY);
  if (fd < 0) ThrowErrno(path, "cannot reopen to flush", errno);
  const int failed = fsync(fd);
  const int code = errno;
  close(fd);
  // Folders on some file systems cannot be flushed; that is not a loss of data.
  if (failed && code != EINVAL) ThrowErrno(path, "cannot flush", code);
}

void WriteAll(int fd, const std::string& path, std::string_view content) {
  while (!content.empty()) {
    const ssize_t written = write(fd, content.data(), content.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) ThrowErrno(path, "cannot write", errno);
    content.remove_prefix(static_cast<size_t>(written));
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
  std::ifstream in(path, std::ios::binary);
  if (!in) throw IoError(path, std::string("cannot open: ") + std::strerror(errno));
  std::ostringstream content;
  content << in.rdbuf();
  if (in.bad()) throw IoError(path, "cannot read");
  return content.str();
}

void WriteFileAtomic(const std::string& path, std::string_view content) {
  WriteFileAtomic(path, [&](const std::string& temporary) {
    const int fd = open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (fd < 0) ThrowErrno(temporary, "cannot create", errno);
    try {
      WriteAll(fd, path, content);
    } catch (...) {
      close(fd);
      throw;
    }
    if (close(fd) != 0) ThrowErrno(path, "cannot close", errno);
  });
}

void WriteFileAtomic(const std::string& path, const std::function<void(const std::string&)>& write) {
  MakeParent(path);
  const std::string temporary = TemporaryBeside(path);
  try {
    write(temporary);
    FlushToDisk(temporary);
    if (rename(temporary.c_str(), path.c_str()) != 0) ThrowErrno(path, "cannot rename into place", errno);
  } catch (...) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    throw;
  }
}

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
  if (had_old) fs::rename(path_, old, code);
  if (code) ThrowErrno(path_, "cannot move the old folder away", code.value());
  fs::rename(work_path_, path_, code);
  if (code) {
    std::error_code ignored;
    if (had_old) fs::rename(old, path_, ignored);
    ThrowErrno(path_, "cannot rename into place", code.value());
  }
  committed_ = true;
  if (had_old) fs::remove_all(old, code);
}

}  // namespace mvstudio
