#pragma once

#include <string>

namespace mvstudio {

enum class OutputKind { kFile, kFolder, kAny };

/// The one name of an output, to be checked, locked, written, recorded and printed: links of its parents are followed, and
/// that of a folder itself; `.` and `..` are gone, and mean what they mean to the system. A relative name stays one. Throws
/// UsageError for a name that is reserved, empty, or a folder's where a file goes; IoError where `..` or a link of a parent
/// leads nowhere.
std::string OutputName(const std::string& path, OutputKind kind);

/// The absolute path of what the system finds under a path, which need not exist, without `.`, `..` and links of parents: the
/// link at its end is followed only where a slash or a dot is behind it. Throws IoError where a parent leads nowhere.
std::string PathOnDisk(const std::string& path);
/// A path of the same file for messages, without needless dots and slashes; links stay where no `..` is behind one.
std::string PlainPath(const std::string& path);

/// Names that mvstudio keeps for itself: its lists, records, locks and work files. Capitals count as small letters, for there
/// are file systems that do not tell them apart.
bool IsReservedName(const std::string& name);
/// Throws UsageError when the last part of an output's path is reserved, or one before it is a work file's or a lock's.
void RequireFreeName(const std::string& path);

/// Throws UsageError when the path of a new folder ends like a file, `points.csv`: who gives such a name expects one.
void RequireFolderName(const std::string& path);

/// Whether a path has the form of a folder's: it ends in `/`, `/.` or `/..`.
bool HasFolderForm(const std::string& path);

}  // namespace mvstudio
