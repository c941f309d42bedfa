#pragma once

#include <string>
#include <vector>

/// What the parts of the door to the disk share (`files`, `output`, `manifest`, `lock`): nobody else includes this.
namespace mvstudio::internal {

/// An open file, closed at the end.
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

/// True when the step is to go ahead (`SetIoFault`); otherwise errno says why not.
bool Allowed(const char* operation, const std::string& path);

/// ResourceError when the device is full, IoError otherwise. `action`: "cannot create".
[[noreturn]] void ThrowErrno(const std::string& path, const std::string& action, int code);

/// Folder of a path; "." when it names none.
std::string ParentOf(const std::string& path);

/// Makes the folder that a path lies in; returns what had to be made, outermost first.
std::vector<std::string> MakeParents(const std::string& path);
/// Removes those that are empty.
void RemoveEmpty(const std::vector<std::string>& folders);

/// Absolute, without `.`, `..` and slashes at the end; symbolic links are not looked at.
std::string Normal(const std::string& path);

/// All that stands at a name, links themselves included.
bool Exists(const std::string& path);

}  // namespace mvstudio::internal
