#pragma once

#include <stdexcept>
#include <string>

namespace mvstudio {

/// Base class of all exceptions of this project. The message is one line: what, where, likely cause, what to do.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A broken precondition: the caller's mistake. Thrown by MVS_CHECK.
class ContractViolation : public Error {
 public:
  using Error::Error;
};

/// Options that contradict each other or name something that does not exist (exit code 2).
class UsageError : public Error {
 public:
  using Error::Error;
};

/// A result that is there already and is kept, because nobody asked to replace it (exit code 2).
class ResultExistsError : public UsageError {
 public:
  ResultExistsError(const std::string& path, const std::string& message) : UsageError(message), path_(path) {}
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// A file or device that cannot be opened, read or written (exit code 3).
class IoError : public Error {
 public:
  IoError(const std::string& path, const std::string& what) : Error(path + ": " + what), path_(path) {}
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// A file whose content violates its format; `where` is e.g. `cameras[3].K[1][2]` (exit code 3).
class FormatError : public Error {
 public:
  FormatError(const std::string& path, const std::string& where, const std::string& what)
      : Error(path + (where.empty() ? "" : ": " + where) + ": " + what), path_(path), where_(where) {}
  const std::string& path() const { return path_; }
  const std::string& where() const { return where_; }

 private:
  std::string path_, where_;
};

/// Disk full, out of memory (exit code 7).
class ResourceError : public Error {
 public:
  using Error::Error;
};

/// A program, model or device that the command needs is missing (exit code 8).
class MissingToolError : public Error {
 public:
  using Error::Error;
};

/// The run was cancelled (exit code 130).
class CancelledError : public Error {
 public:
  using Error::Error;
};

}  // namespace mvstudio
