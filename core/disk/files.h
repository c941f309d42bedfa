#pragma once

#include <functional>
#include <string>
#include <string_view>

namespace mvstudio {

/// Whole content of a file, or of a pipe that somebody writes to (at most 1 GiB, 10 s without a byte). Throws IoError; devices,
/// sockets and pipes without a writer are refused.
std::string ReadFile(const std::string& path);

/// Writes `content` to a hidden file beside `path`, flushes it to the disk, then renames it into place: afterwards `path` holds
/// either the old or the whole new content. Creates missing folders. A file that is there already is replaced only when it is
/// ours and unchanged (core/disk/manifest.h); otherwise UsageError. Throws IoError, or ResourceError when the device is full.
/// Inside the work folder of an `AtomicFolder` the file is written straight away: the folder is flushed as a whole.
void WriteFileAtomic(const std::string& path, std::string_view content);

/// Same for writers that need a path of their own: `write(temporary_path)` fills the file (it keeps the extension of `path`).
void WriteFileAtomic(const std::string& path, const std::function<void(const std::string&)>& write);

/// Creates a file and writes `content`, not atomically: for the temporary paths that the function above hands out, and for work
/// folders. A file that is there is taken away first, never written into: it may be a link to another.
void WriteFile(const std::string& path, std::string_view content);
/// Appends to a temporary file of that kind.
void AppendToFile(const std::string& temporary_path, std::string_view content);

/// A copy, one more name of the same file, or a symbolic link; `to` lies in a work folder and is not there yet. HardLink is
/// false where the file system cannot do it.
void CopyFile(const std::string& from, const std::string& to);
bool HardLink(const std::string& from, const std::string& to);
void MakeSymbolicLink(const std::string& target, const std::string& link);

/// Removes a file or folder that lies in a work folder.
void RemoveFromWork(const std::string& path);

/// Makes a file's content, or what was created, renamed or removed in a folder, survive a loss of power. Throws IoError or
/// ResourceError.
void FlushToDisk(const std::string& file_or_folder);

/// Adds one line (a newline is added) to a file that is ours, or makes it: the whole file is replaced as by WriteFileAtomic.
void AppendLine(const std::string& path, std::string_view line);

/// Creates the folder and its parents. Throws IoError or ResourceError.
void MakeFolder(const std::string& path);

/// For tests of what happens when the disk fails or the process dies: called before each step of the functions above ("create",
/// "write", "flush", "close", "rename", "remove", "folder"). Returns 0, or the errno that the step then fails with.
using IoFault = int (*)(const char* operation, const std::string& path);
/// nullptr, which is how a program starts, means none. Returns the one before.
IoFault SetIoFault(IoFault fault);

}  // namespace mvstudio
