#pragma once

#include <string>
#include <vector>

/// Shared by `files`, `output`, `manifest` and `lock`; not included elsewhere.
namespace mvstudio::internal {

/// An open file, closed on destruction.
struct Descriptor {
  explicit Descriptor(int fd_) : fd(fd_) {}
  ~Descriptor();
  Descriptor(Descriptor&& other) noexcept : fd(other.Release()) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  Descriptor& operator=(Descriptor&&) = delete;
  int Release();
  int fd;
};

/// True when the step may proceed (`SetIoFault`); otherwise errno holds the reason.
bool Allowed(const char* operation, const std::string& path);

/// ResourceError when the device is full, IoError otherwise. `action`: "cannot create".
[[noreturn]] void ThrowErrno(const std::string& path, const std::string& action, int code);

/// Folder of a path; "." when it names none.
std::string ParentOf(const std::string& path);

/// Creates the parent folder of a path; returns the folders created, outermost first.
std::vector<std::string> MakeParents(const std::string& path);
/// Removes those that are empty.
void RemoveEmpty(const std::vector<std::string>& folders);

/// Absolute path without `.`, `..` and trailing slashes; symbolic links are not resolved.
std::string Normal(const std::string& path);

/// Whether anything has this name, including a symbolic link itself.
bool Exists(const std::string& path);

}  // namespace mvstudio::internal
