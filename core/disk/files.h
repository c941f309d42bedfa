#pragma once

#include <functional>
#include <string>
#include <string_view>

namespace mvstudio {

/// Whole content of a file, or of a pipe with a writer (at most 1 GiB, 10 s without a byte). Throws IoError; devices,
/// sockets and pipes without a writer are refused.
std::string ReadFile(const std::string& path);

/// Writes `content` to a hidden file beside `path`, flushes it to disk, then renames it: afterwards `path` holds either
/// the old or the complete new content. Creates missing folders. An existing file is replaced only when mvstudio wrote it
/// and it is unchanged (core/disk/manifest.h); otherwise UsageError. Throws IoError, or ResourceError when the device is
/// full. Inside the work folder of an `AtomicFolder` the file is written directly: the folder is flushed as a whole.
void WriteFileAtomic(const std::string& path, std::string_view content);

/// Same for writers that need a path: `write(temporary_path)` fills the file (it keeps the extension of `path`).
void WriteFileAtomic(const std::string& path, const std::function<void(const std::string&)>& write);

/// Creates a file and writes `content`, not atomically: for the temporary paths of the function above, and for work
/// folders. An existing file is removed first, never written into, because it may be a link to another.
void WriteFile(const std::string& path, std::string_view content);
/// Appends to such a temporary file.
void AppendToFile(const std::string& temporary_path, std::string_view content);

/// Only the user may read such a temporary file, and what it becomes (mode 0600).
void MakePrivate(const std::string& temporary_path);

/// A copy, a hard link, or a symbolic link; `to` is in a work folder and does not exist yet. HardLink is false where the
/// file system does not support it.
void CopyFile(const std::string& from, const std::string& to);
bool HardLink(const std::string& from, const std::string& to);
void MakeSymbolicLink(const std::string& target, const std::string& link);

/// Removes a file or folder inside a work folder.
void RemoveFromWork(const std::string& path);

/// Flushes a file's content, or the entries of a folder, so that they survive a power loss. Throws IoError or
/// ResourceError.
void FlushToDisk(const std::string& file_or_folder);

/// Appends one line (with a newline) to a file of mvstudio, or creates it: the whole file is replaced as by
/// WriteFileAtomic.
void AppendLine(const std::string& path, std::string_view line);

/// Creates the folder and its parents. Throws IoError or ResourceError.
void MakeFolder(const std::string& path);

/// Fault injection for tests: called before each step of the functions above ("create", "write", "flush", "close",
/// "rename", "remove", "folder"). Returns 0, or the errno with which the step fails.
using IoFault = int (*)(const char* operation, const std::string& path);
/// nullptr, the initial state, means none. Returns the previous one.
IoFault SetIoFault(IoFault fault);

}  // namespace mvstudio
