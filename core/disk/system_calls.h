// Private: for the .cc files of this folder.
#pragma once

#include <string>

/// Calls of the system, their failures and those that tests ask for.
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

/// Whether anything has this name, including a symbolic link itself.
bool Exists(const std::string& path);

}  // namespace mvstudio::internal
